"""Policies and episodes that several tests of the evaluation use."""

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.metrics.jump import JumpMetrics
from icub_jump_env.policy import NetworkPolicy, save_policy

FEEDBACK = NetworkPolicy(
    ("gyro.y", "com_velocity.x", "time"),
    ((np.array([[0.2, 0.3, 0.5], [-0.3, 0.1, -0.4]], np.float32), np.zeros(2, np.float32)),),
    ("forward", "vertical"),
    0.3,
)
"""A policy whose action changes from step to step."""


def evaluate(capsys, *arguments):
    """Exit code, stdout and stderr of eval.py with these arguments."""
    code = 0
    try:
        cli.evaluate([str(argument) for argument in arguments])
    except SystemExit as end:
        code = end.code
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def refusal(capsys, *arguments):
    """The one line that it refuses with."""
    code, out, err = evaluate(capsys, *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    return err


def constant(*action):
    """The network that always does the same."""
    return NetworkPolicy((), ((np.zeros((3, 0), np.float32), np.array(action, np.float32)),))


def save(path, policy, **config):
    """A policy on disk, trained in the environment of ``config``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_policy(
        path, policy, config=JumpConfig.of(**config), versions={}, command=(), seed=0, results={}
    )
    return path


def save_constant(path, *action, **config):
    return save(path, constant(*action), **config)


def episode(seed, failure=None, jump_height=0.04, **jump):
    """An episode that nobody jumped."""
    return Episode(
        seed=seed,
        jump_height=jump_height,
        outcome="stood" if failure is None else "fell",
        is_success=failure is None,
        reward=2.5,
        jump=JumpMetrics().as_dict() | {"landed": failure is None} | jump,
        failure=failure,
        world={"friction": 0.5},
    )


def outcomes(pattern, rise=0.04, **jump):
    """Episodes that succeed where the pattern has a 1."""
    return [
        episode(seed, None if char == "1" else Failure.SLIPPED, flight_height=rise, **jump)
        for seed, char in enumerate(pattern)
    ]
