"""A policy's jump: where it moves the CoM reference, and what comes of it."""

from __future__ import annotations

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import Episode, planned
from icub_jump_env.evaluation.figures.style import (
    ACCENT,
    DESIRED,
    MEASURED,
    Figure,
    describe,
    mark_takeoff,
    panels,
)
from icub_jump_env.evaluation.quantities import CM, DEG

_AFTER = 0.8
"""Shown after the commanded take-off (s)."""


def policy_figure(config: JumpConfig, policy: Episode, baseline: Episode) -> Figure:
    """The policy's offset of the CoM reference, and CoM height and base pitch of both jumps.

    Args:
        config: The jump.
        policy: Its traced episode with the policy.
        baseline: The same without.
    """
    takeoff = planned(config).duration
    figure, ((offset, height, pitch),) = panels((11.0, 3.4), columns=3)
    pairs = [
        (ours.time, ours.com_reference - theirs.com_reference)
        for ours, theirs in zip(policy.trace, baseline.trace, strict=False)
        if ours.phase == theirs.phase == "launch"
    ]
    time, moved = [time for time, _ in pairs], CM * np.array([shift for _, shift in pairs])
    for axis, name, color in zip(
        range(3), ("forward", "left", "up"), (MEASURED, ACCENT, DESIRED), strict=True
    ):
        offset.plot(time, moved[:, axis], color=color, label=name)
    for episode, name, color in ((baseline, "baseline", ACCENT), (policy, "policy", MEASURED)):
        shown = [s for s in episode.trace if s.time <= takeoff + _AFTER]
        times = [s.time for s in shown]
        height.plot(times, [s.com[2] for s in shown], color=color, label=name)
        pitch.plot(times, [DEG * s.base_pitch for s in shown], color=color, label=name)
    for axis, title, unit in (
        (offset, "offset of the CoM reference", "cm"),
        (height, "CoM height", "m"),
        (pitch, "base pitch (positive: forward)", "deg"),
    ):
        describe(axis, title, unit)
        mark_takeoff(axis, takeoff, "commanded take-off")
        place = "upper left" if axis is offset else "upper right"
        axis.legend(frameon=False, fontsize=8, loc=place)
    return figure
