"""The examples: they run as printed, and do what they say."""

import os
import re
import subprocess
import sys
from pathlib import Path

from icub_jump_env.export.cli import export

REPOSITORY = Path(__file__).parents[1]


def run(name, *words):
    command = [sys.executable, REPOSITORY / "examples" / name, *words]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    return subprocess.run(
        command, check=True, capture_output=True, text=True, env=environment
    ).stdout


def test_plain_mujoco_jumps_as_the_environment_does():
    rise = re.fullmatch(r"rise (\d\.\d) cm, stands\n", run("plain_mujoco.py"))
    assert abs(float(rise[1]) - 4.0) <= 0.2


def test_a_replayed_log_gives_the_commands_that_were_given(capsys):
    export(["jump", "jump.csv"])
    found = re.fullmatch(
        r"87 ticks, largest difference (\S+) rad/s\n", run("replay_log.py", "jump.csv")
    )
    assert float(found[1]) < 1e-9
