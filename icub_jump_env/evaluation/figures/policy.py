"""The picture of a policy's jump: where it moves the CoM reference, and what comes of it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.figures.paper import ACCENT, DESIRED, MEASURED
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import CM, DEG
from icub_jump_env.reference.com_trajectory import plan_com_trajectory

_AFTER = 0.8
"""Shown after the commanded take-off (s)."""


def policy_figure(config: JumpConfig, policy: Episode, baseline: Episode) -> Figure:
    """The policy's offset of the CoM reference, and CoM height and base pitch of both jumps.

    Args:
        config: The jump.
        policy: Its traced episode with the policy.
        baseline: The same without.
    """
    takeoff = plan_com_trajectory(
        config.commanded_height, config.com_displacement, config.com_scaling
    ).duration
    figure = Figure(figsize=(11.0, 3.4), dpi=150, layout="constrained")
    offset, height, pitch = figure.subplots(1, 3)
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
    offset.legend(frameon=False)
    for episode, name, color in ((baseline, "baseline", ACCENT), (policy, "policy", MEASURED)):
        shown = [s for s in episode.trace if s.time <= takeoff + _AFTER]
        times = [s.time for s in shown]
        height.plot(times, [s.com[2] for s in shown], color=color, label=name)
        pitch.plot(times, [DEG * s.base_pitch for s in shown], color=color)
    height.legend(frameon=False)
    for axis, title, unit in (
        (offset, "offset of the CoM reference", "cm"),
        (height, "CoM height", "m"),
        (pitch, "base pitch (positive: forward)", "deg"),
    ):
        _finish(axis, title, unit, takeoff)
    return figure


def _finish(axis: Axes, title: str, unit: str, takeoff: float) -> None:
    axis.axvline(takeoff, color=ACCENT, lw=0.8, ls=":")
    axis.set(title=title, xlabel="time (s)", ylabel=unit)
    axis.spines[["top", "right"]].set_visible(False)
