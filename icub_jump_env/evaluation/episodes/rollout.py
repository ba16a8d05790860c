"""Episodes of a policy; without one, of the pure QP baseline."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.episodes.failures import Failure, failure_in
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.policy import BASELINE, Baseline, Policy
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.snapshot import Snapshot

Frame = NDArray[np.uint8]


@dataclass(frozen=True)
class Episode:
    """One finished episode.

    Attributes:
        seed: Seed of its reset.
        jump_height: Commanded height (m).
        outcome: ``stood``, ``fell``, ``no take-off`` or ``diverged``.
        is_success: Whether it counts as a success.
        reward: Sum of its rewards.
        jump: Metrics of the last jump by name, SI units.
        failure: Class of the failure, if it was one.
        world: What was drawn at the reset.
        series: ``info["series"]``; empty of a single jump.
        trace: Snapshots at the control rate, if asked for.
    """

    seed: int
    jump_height: float
    outcome: str
    is_success: bool
    reward: float
    jump: dict[str, Any]
    failure: Failure | None = None
    world: dict[str, Any] = field(default_factory=dict)
    series: dict[str, Any] = field(default_factory=dict)
    trace: tuple[Snapshot, ...] = ()

    @property
    def landed(self) -> bool:
        """Whether the robot landed and stands; of a series, after all of its jumps."""
        if not self.series:
            return bool(self.jump["landed"])
        # A series that does not go on has landed every jump that began.
        return self.outcome == "stood" and bool(self.series["landed"] == self.series["jumps"])


def make_env(config: JumpConfig) -> ICubJumpEnv:
    """The environment of a configuration, without wrappers."""
    return ICubJumpEnv(**vars(config))


def traced(config: JumpConfig) -> JumpConfig:
    """The same jump, stepped once per control tick; with a zero action nothing else changes."""
    return dataclasses.replace(config, agent_frequency=config.controller_config.frequency)


def planned(config: JumpConfig) -> JumpPlan:
    """The plan of a configuration with a single command."""
    planner = config.make_planner(FeetFixedKinematics(config.robot_value))
    return planner.plan(config.commanded_height)


def run_episode(
    env: ICubJumpEnv,
    seed: int,
    policy: Policy = BASELINE,
    trace: bool = False,
    on_step: Callable[[ICubJumpEnv], None] | None = None,
    hold: int = 1,
) -> Episode:
    """Run one episode.

    Args:
        env: The environment.
        seed: Seed of the reset.
        policy: What acts.
        trace: Whether to take a snapshot at each step.
        on_step: Called after the reset and after each step.
        hold: Steps that an action is held, where the environment is stepped faster than
            the policy acts.

    Returns:
        The episode.
    """
    snapshots = []
    observation, info = env.reset(seed=seed)
    world = info["world"]
    terminated, total = False, 0.0
    still = np.zeros(env.action_space.shape or (), np.float32)
    for step in itertools.count():
        if trace:
            snapshots.append(env.snapshot())
        if on_step is not None:
            on_step(env)
        if terminated:
            break
        if step % hold == 0:
            action = still if isinstance(policy, Baseline) else policy(observation)
        observation, reward, terminated, _, info = env.step(action)
        total += reward
    return Episode(
        seed=seed,
        jump_height=info["jump_height"],
        outcome=info["outcome"],
        is_success=info["is_success"],
        reward=total,
        jump=info["jump"],
        failure=failure_in(info, env.config.success),
        world=world,
        series=info.get("series", {}),
        trace=tuple(snapshots),
    )
