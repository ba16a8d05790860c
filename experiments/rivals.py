"""Rivals of a learned residual that keep it honest: a constant shift, and its own mean."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from agents.environment import acting_steps
from experiments.seeds import TUNING
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.report.output import progress_display
from icub_jump_env.observation import Layout
from icub_jump_env.planning.residual import COM_AXES, AxisName
from icub_jump_env.policy import NetworkPolicy, Policy, ReplayPolicy

FORWARD = tuple(np.round(np.arange(0.0, 0.81, 0.1), 3))
VERTICAL = (-1.0, -0.5, 0.0, 0.5)
"""Constant actions that are tried."""

WITH_MOMENTUM = ((-0.2, 0.0, 0.2, 0.4), (-0.5, 0.0, 0.5), (-0.5, 0.0, 0.5))
"""Forward, vertical and pitch where there is the last, fewer of each."""

_COMMANDS = 9
"""Commands at which the mean action is taken, evenly over the range."""


def constant_shift(forward: float, vertical: float, pitch: float | None = None) -> NetworkPolicy:
    """The policy whose action is always the same; with pitch, on those three axes alone."""
    axes: tuple[AxisName, ...] = ("forward", "vertical")
    values, all_axes = [forward, vertical], COM_AXES
    if pitch is not None:
        axes = all_axes = (*axes, "pitch")
        values.append(pitch)
    bias = np.array(values, np.float32)
    layer = np.zeros((len(bias), 0), np.float32), bias
    entries = tuple(Layout(axes=all_axes).scales)
    return NetworkPolicy((), (layer,), axes, action_axes=all_axes, entries=entries)


def best_constant(
    config: JumpConfig, jobs: int, console: Console, seeds: Sequence[int] = TUNING[:60]
) -> NetworkPolicy:
    """The constant shift with the largest mean reward.

    Args:
        config: The jump.
        jobs: Number of worker processes.
        console: Where the progress is shown.
        seeds: Episodes of each shift.
    """
    grid = WITH_MOMENTUM if "pitch" in config.residual.axes else (FORWARD, VERTICAL)
    shifts = [constant_shift(*shift) for shift in itertools.product(*grid)]
    work = [Job(config, seed, shift) for shift in shifts for seed in seeds]
    rewards = [episode.reward for episode in run_all(work, jobs, console)]
    scores = np.reshape(rewards, (len(shifts), -1)).mean(axis=1)
    return shifts[int(np.argmax(scores))]


def open_loop(
    policy: Policy, config: JumpConfig, console: Console, seeds: Sequence[int] = TUNING
) -> ReplayPolicy:
    """A policy's mean action by command and time, to be replayed whatever happens.

    Args:
        policy: The policy.
        config: The jump.
        console: Where the progress is shown.
        seeds: Episodes whose actions are averaged, dealt out to the commands.
    """
    commands = np.unique(np.linspace(*config.jump_heights, _COMMANDS))  # or there is only one
    axes = config.residual.axes
    sums = np.zeros((len(commands), acting_steps(config), len(axes)))
    counts = np.zeros((*sums.shape[:2], 1))
    with progress_display(console) as display:
        task = display.add_task("averaging", total=len(seeds))
        for i, command in enumerate(commands):
            env = make_env(dataclasses.replace(config, jump_height=float(command)))
            for seed in seeds[i :: len(commands)]:
                watched = Watched(policy)
                run_episode(env, seed, watched)
                # A launch shorter than the longest one is followed by steps without effect;
                # a fall may come before the longest one ends.
                actions = watched.actions[: sums.shape[1]]
                sums[i, : len(actions)] += actions
                counts[i, : len(actions)] += 1
                display.advance(task)
            env.close()
    means = sums / np.maximum(counts, 1)
    return ReplayPolicy(
        commands.astype(np.float32), means.astype(np.float32), config.agent_frequency, axes
    )


class Watched:
    """A policy that remembers what it saw and did.

    Attributes:
        observations: (n,) each.
        actions: (axes,) each.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self.observations: list[NDArray[np.float32]] = []
        self.actions: list[NDArray[np.float32]] = []

    def __call__(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """The action for an observation."""
        self.observations.append(observation)
        self.actions.append(self._policy(observation))
        return self.actions[-1]
