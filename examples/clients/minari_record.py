# /// script
# dependencies = ["minari[create,hdf5]"]
# ///
"""Record episodes as a Minari dataset, as they are jumped, and read them back."""

import os
from tempfile import TemporaryDirectory

import gymnasium

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

with TemporaryDirectory() as folder:
    os.environ["MINARI_DATASETS_PATH"] = folder
    import minari

    env = minari.DataCollector(gymnasium.make("icub_jump_env:ICubJump-v1", **TASK))
    env.action_space.seed(0)
    for seed in range(3):
        env.reset(seed=seed)
        ended = False
        while not ended:
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            ended = terminated or truncated
    env.create_dataset("icub/random-v0")
    env.close()
    dataset = minari.load_dataset("icub/random-v0")
    print(f"{dataset.total_episodes} episodes recorded, {dataset.total_steps} steps")
