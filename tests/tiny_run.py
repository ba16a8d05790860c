"""Trainings that take a second, and what their tests share."""

import json

import psutil

from agents import cli
from agents.options import PPOOptions, TrainOptions
from icub_jump_env.config import JumpConfig

SEEDS = range(10_000, 10_002)
"""Of the evaluations."""

PPO = PPOOptions(episodes=2, batch_size=16, epochs=1, hidden=(8,), critic_hidden=(8,))

ARGUMENTS = (
    *("--stand-time", "0.1", "--jobs", "2", "--timesteps", "200", "--checkpoint-every", "1"),
    *("--ppo.episodes", "2", "--ppo.batch-size", "16", "--ppo.epochs", "1", "--ppo.ramp", "1"),
    *("--ppo.hidden", "8", "--ppo.critic-hidden", "8", "--ppo.log-std", "-1.0", "-1.2"),
    *("--ppo.warmup", "1", "--evaluation-episodes", "2"),
)
"""Three updates of two episodes, four checkpoints; the policy changes from the second on."""


UNUSUAL = TrainOptions(
    env=JumpConfig.of(
        controller="torque",
        jump_height=0.03,
        com_scaling="acceleration",
        actuators={"motor": {"kind": "dc", "current_limit": 0.5}},
        sensors="realistic",
        residual_scale=(0.01, 0.0, 0.1),
    ),
    ppo=PPOOptions(episodes=6, hidden=(7, 5, 3), log_std=(-0.1, -3.0), learning_rate=1e-3 / 3),
    inputs="command",
    axes=("lateral",),
    timesteps=12345,
    seed=2**32 - 1,
    jobs=3,
    checkpoint_every=2,
    evaluation_episodes=5,
)
"""Nothing as by default."""


def train(patch, *arguments):
    """Exit code of train.py with these arguments."""
    patch.setattr("sys.argv", ["train.py", *arguments])
    try:
        cli.run([*arguments])
    except SystemExit as end:
        return end.code
    return 0


def written(folder):
    """Content of the files in a folder, by name."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def results(folder):
    """The same without what is not bit for bit: the times in TensorBoard's files and the curve."""
    found = {
        name: content
        for name, content in written(folder).items()
        if not name.startswith("tensorboard")
    }
    if "curve.json" in found:
        found["curve.json"] = json.loads(found["curve.json"]) | {"minutes": None}
    return found


def children():
    """Except Python's resource tracker, which lives as long as this process."""
    trackers = "multiprocessing.resource_tracker"
    return [p for p in psutil.Process().children() if trackers not in " ".join(p.cmdline())]
