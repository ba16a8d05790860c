"""Clients of the environment that run in seconds, where they are installed."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
CLIENTS = REPOSITORY / "examples" / "clients"

RETURN = r"[1-9]\d* steps learned, return -?\d+\.\d ± \d+\.\d"
QUICK = {
    "checkers": ("stable_baselines3", "no error and no warning"),
    "gymnasium_make_vec": ("gymnasium", "300 steps of 2 environments: .*"),
    "sb3_contrib_recurrent_ppo": ("sb3_contrib", RETURN),
    "sb3_ppo": ("stable_baselines3", RETURN),
    "sb3_sac": ("stable_baselines3", RETURN),
    "skrl_ppo": ("skrl", "1024 steps learned"),
    "torchrl_gym_env": ("torchrl", r"1024 steps collected, [1-9]\d* episodes ended"),
}
"""The module that each imports, and its last line."""
ELSEWHERE = {
    "gymnasium_record_video": "moviepy wants an older pillow",
    "minari_record": "jax: 600 MB",
    "rl_zoo3_train_enjoy": "older versions, minutes",
    "rllib_ppo": "minutes",
}
"""Why not here; `python examples/clients/run.py` runs them."""


def test_each_client_is_run_here_or_there():
    files = {file.stem for file in CLIENTS.glob("*.py")} - {"run"}
    assert files == QUICK.keys() | ELSEWHERE.keys()


@pytest.mark.parametrize("client", QUICK)
def test_a_client_runs(client, tmp_path):
    module, says = QUICK[client]
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"needs {module}")
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", CLIENTS / f"{client}.py"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert re.fullmatch(says, ran.stdout.splitlines()[-1])
