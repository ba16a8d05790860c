"""Policies that several tests use."""

from itertools import pairwise

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.policy import NetworkPolicy, ReplayPolicy


def make_network(inputs, hidden=(), axes=("forward", "lateral", "vertical"), scale=1.0, seed=0):
    """A network with random weights."""
    rng = np.random.default_rng(seed)
    widths = (len(inputs), *hidden, len(axes))
    layers = tuple(
        (
            rng.normal(size=(n_out, n_in)).astype(np.float32),
            rng.normal(size=n_out).astype(np.float32),
        )
        for n_in, n_out in pairwise(widths)
    )
    return NetworkPolicy(inputs, layers, axes, scale)


def make_replay(n_commands=3, n_steps=5, frequency=100.0):
    """A table with random actions."""
    rng = np.random.default_rng(0)
    commands = np.linspace(0.02, 0.08, n_commands).astype(np.float32)
    actions = rng.uniform(-1, 1, (n_commands, n_steps, 3)).astype(np.float32)
    return ReplayPolicy(commands, actions, frequency)


def random_observation(rng):
    return rng.uniform(-10, 10, 80).astype(np.float32)


POLICIES = {
    "network": make_network(
        ("gyro.y", "phase.launch", "time"), (7, 4), ("forward", "vertical"), 0.3
    ),
    "constant": make_network((), axes=("forward",), scale=0.5),
    "replay": make_replay(),
}

DETAILS = {
    "config": JumpConfig(),
    "versions": {"numpy": np.__version__},
    "command": ["python", "train.py", "--seed", "3"],
    "seed": 3,
    "results": {"success": {"full": 0.83, "interval": [0.77, 0.88]}, "rise": None},
}
"""What save_policy wants to know beside the policy."""
