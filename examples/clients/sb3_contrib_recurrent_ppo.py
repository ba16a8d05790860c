# /// script
# dependencies = ["sb3-contrib"]
# ///
"""PPO with a recurrent policy (LSTM) of sb3-contrib."""

import gymnasium
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.evaluation import evaluate_policy

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

env = gymnasium.make("icub_jump_env:ICubJump-v1", **TASK)
model = RecurrentPPO("MlpLstmPolicy", env, n_steps=128, gamma=0.999, seed=0).learn(128)
mean, deviation = evaluate_policy(model, model.get_env(), n_eval_episodes=2)
print(f"128 steps learned, return {mean:.1f} ± {deviation:.1f}")
