"""Episodes of the pure QP baseline."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.failures import Failure, failure_of
from icub_jump_env.snapshot import Snapshot

Frame = NDArray[np.uint8]


@dataclass(frozen=True)
class Episode:
    """One finished episode.

    Attributes:
        seed: Seed of its reset.
        outcome: ``stood``, ``fell``, ``no take-off`` or ``diverged``.
        is_success: Whether it counts as a success.
        jump: Metrics by name, SI units.
        failure: Class of the failure, if it was one.
        world: What was drawn at the reset.
        trace: Snapshots at the control rate, if asked for.
    """

    seed: int
    outcome: str
    is_success: bool
    jump: dict[str, Any]
    failure: Failure | None = None
    world: dict[str, Any] = field(default_factory=dict)
    trace: tuple[Snapshot, ...] = ()


def make_env(config: JumpConfig) -> ICubJumpEnv:
    """The environment of a configuration, without wrappers."""
    return ICubJumpEnv(**dataclasses.asdict(config))


def traced(config: JumpConfig) -> JumpConfig:
    """The same jump, stepped once per control tick; with a zero action nothing else changes."""
    return dataclasses.replace(config, agent_frequency=config.control_rate)


def run_episode(
    env: ICubJumpEnv,
    seed: int,
    trace: bool = False,
    on_step: Callable[[ICubJumpEnv], None] | None = None,
) -> Episode:
    """Run one episode with a zero residual.

    Args:
        env: The environment.
        seed: Seed of the reset.
        trace: Whether to take a snapshot at each step.
        on_step: Called after the reset and after each step.

    Returns:
        The episode.
    """
    zero = np.zeros(3, dtype=np.float32)
    snapshots = []
    _, info = env.reset(seed=seed)
    world = info["world"]
    terminated = False
    while True:
        if trace:
            snapshots.append(env.snapshot())
        if on_step is not None:
            on_step(env)
        if terminated:
            break
        _, _, terminated, _, info = env.step(zero)
    outcome, jump = info["outcome"], info["jump"]
    failure = failure_of(outcome, jump, info["jump_height"])
    return Episode(seed, outcome, info["is_success"], jump, failure, world, tuple(snapshots))
