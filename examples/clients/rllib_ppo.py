# /// script
# dependencies = ["ray[rllib]==2.60.0", "gymnasium==1.2.2", "torch"]  # it wants this Gymnasium
# ///
"""PPO of RLlib, whose processes make the environment by its name."""

from tempfile import TemporaryDirectory

from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

if __name__ == "__main__":
    network = DefaultModelConfig(fcnet_hiddens=[64, 64], fcnet_activation="tanh")
    algorithm = (
        PPOConfig()
        .environment("icub_jump_env:ICubJump-v1", env_config=TASK)  # each process imports it
        .env_runners(num_env_runners=1, sample_timeout_s=600.0)  # the first jump compiles
        .training(train_batch_size=1024, minibatch_size=256, num_epochs=10)
        .training(lr=5e-4, gamma=0.999, lambda_=0.98)
        .rl_module(model_config=network)
        .build_algo()
    )
    for _ in range(2):
        result = algorithm.train()["env_runners"]
    with TemporaryDirectory() as folder:
        algorithm.save_to_path(folder)
    algorithm.stop()
    print(f"2 iterations of 1024 steps, return {result['episode_return_mean']:.1f}")
