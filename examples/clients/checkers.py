# /// script
# dependencies = ["stable-baselines3"]
# ///
"""The checkers of Gymnasium and Stable-Baselines3, on both versions; a warning is an error."""

import warnings

import gymnasium
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common import env_checker

for version in ("v0", "v1"):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The paper's jump is not out of date: v1 is another one.
        warnings.filterwarnings("ignore", ".*ICubJump-v0 is out of date", DeprecationWarning)
        name = f"icub_jump_env:ICubJump-{version}"
        # Without a display there is no window to check.
        check_env(gymnasium.make(name).unwrapped, skip_render_check=True)
        env_checker.check_env(gymnasium.make(name, render_mode="rgb_array"))
print("no error and no warning")
