# /// script
# dependencies = ["stable-baselines3"]
# ///
"""PPO of Stable-Baselines3, environments in processes, observations and rewards normalised."""

from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import SubprocVecEnv, VecNormalize

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

if __name__ == "__main__":  # the processes import this file
    envs = make_vec_env(
        "icub_jump_env:ICubJump-v1", n_envs=2, env_kwargs=TASK, vec_env_cls=SubprocVecEnv
    )
    envs = VecNormalize(envs, gamma=0.999)
    model = PPO("MlpPolicy", envs, n_steps=128, gamma=0.999, seed=0).learn(256)
    envs.training = envs.norm_reward = False
    mean, deviation = evaluate_policy(model, envs, n_eval_episodes=2)
    envs.close()
    print(f"256 steps learned, return {mean:.1f} ± {deviation:.1f}")
