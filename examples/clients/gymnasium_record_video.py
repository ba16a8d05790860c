# /// script
# dependencies = ["moviepy"]
# ///
"""Film an episode with Gymnasium's RecordVideo."""

from pathlib import Path
from tempfile import TemporaryDirectory

import gymnasium
import numpy as np

with TemporaryDirectory() as folder:
    env = gymnasium.make(
        "icub_jump_env:ICubJump-v1", render_mode="rgb_array", width=320, height=240
    )
    env = gymnasium.wrappers.RecordVideo(env, folder)
    env.reset(seed=0)
    ended = False
    while not ended:
        _, _, ended, _, _ = env.step(np.zeros(env.action_space.shape, np.float32))
    env.close()
    video = next(Path(folder).glob("*.mp4"))
    print(f"{video.name}, {video.stat().st_size // 1000} kB")
