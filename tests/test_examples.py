"""The examples: they run as printed, and do what they say."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.export.cli import export
from icub_jump_env.policy import load_policy

REPOSITORY = Path(__file__).parents[1]


def run(name, *words):
    command = [sys.executable, "-W", "ignore", REPOSITORY / "examples" / name, *words]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    return subprocess.run(
        command, check=True, capture_output=True, text=True, env=environment
    ).stdout


@pytest.mark.parametrize(("controller", "height"), [("velocity", 4.0), ("torque", 3.7)])
def test_plain_mujoco_jumps_as_the_environment_does(controller, height):
    rise = re.fullmatch(r"rise (\d\.\d) cm, stands\n", run("plain_mujoco.py", controller))
    assert abs(float(rise[1]) - height) <= 0.2


def test_a_replayed_log_gives_the_commands_that_were_given(capsys):
    export(["jump", "jump.csv"])
    found = re.fullmatch(
        r"87 ticks, largest difference (\S+) rad/s\n", run("replay_log.py", "jump.csv")
    )
    assert float(found[1]) < 1e-9


def test_ppo_in_one_file_saves_a_policy_that_acts():
    pytest.importorskip("torch")
    out = run("ppo.py", "--steps", "2048")
    assert re.search(r"^2048 steps: \d+ of \d+ episodes succeed$", out, re.MULTILINE)
    policy = load_policy("runs/ppo/policy.safetensors")
    env = make_env(policy.card.config)
    observation, _ = env.reset(seed=0)
    assert np.abs(policy(observation)).max() > 0.0  # it has learned something
