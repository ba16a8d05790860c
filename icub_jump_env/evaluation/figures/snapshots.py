"""Pictures of the jump's moments, as the paper's Fig. 5 shows them."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.episodes.rollout import Episode, Frame, make_env, run_episode, traced
from icub_jump_env.evaluation.figures.style import INK

STRIP_WIDTH = 1600
"""Width of the strip (pixels)."""

_CROP = (slice(0, 460), slice(60, 520))
"""Rows and columns of a picture where the robot is, upright or fallen on its back."""

_ENDS = {"stood": "Stands", "fell": "Falls"}
_DPI = 100


@dataclass(frozen=True)
class Shot:
    """One moment of an episode.

    Attributes:
        name: What happens.
        time: Time since the start of the episode (s).
        picture: (height, width, 3) the whole view.
    """

    name: str
    time: float
    picture: Frame

    @property
    def close_up(self) -> Frame:
        """The square part of the picture that shows the robot."""
        return self.picture[_CROP]


def take_snapshots(config: JumpConfig, episode: Episode) -> list[Shot]:
    """Picture crouch, take-off, apex, first impact and end of a jump, which jumps once more.

    Args:
        config: The jump.
        episode: Its traced episode, without a policy.

    Returns:
        The moments in order; without a flight only the first and the last.

    Raises:
        MissingDependencyError: If there is no OpenGL.
    """
    moments = _moments(episode)
    pictures: dict[int, Frame] = {}
    steps = itertools.count()

    def look(env: ICubJumpEnv) -> None:
        step = next(steps)
        if step in moments.values():
            pictures[step] = env.render()

    visible = traced(config).replace(render_mode="rgb_array")
    with contextlib.closing(make_env(visible)) as env:
        run_episode(env, episode.seed, on_step=look)
    return [Shot(name, episode.trace[step].time, pictures[step]) for name, step in moments.items()]


def snapshot_strip(config: JumpConfig, episode: Episode) -> Figure:
    """The moments of :func:`take_snapshots` side by side; see :func:`draw_strip`."""
    return draw_strip(take_snapshots(config, episode))


def draw_strip(shots: Sequence[Shot]) -> Figure:
    """Lay out the shots side by side, each labelled with its name and time.

    Returns:
        A figure ``STRIP_WIDTH`` pixels wide at its own resolution, that of ``savefig``.
    """
    gap, label = 10, 58
    side = (STRIP_WIDTH - gap * (len(shots) - 1)) / len(shots)
    height = side + label
    figure = Figure(figsize=(STRIP_WIDTH / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    for index, shot in enumerate(shots):
        left = index * (side + gap)
        axes = figure.add_axes(
            (left / STRIP_WIDTH, label / height, side / STRIP_WIDTH, side / height)
        )
        axes.imshow(shot.close_up)
        axes.set_axis_off()
        center = (left + side / 2) / STRIP_WIDTH
        for text, y, size, weight in (
            (shot.name, 40, 15, "bold"),
            (f"{shot.time:.3f} s", 15, 13, "normal"),
        ):
            figure.text(
                center, y / height, text, ha="center", va="center",
                color=INK, fontsize=size, fontweight=weight,
            )  # fmt: skip
    return figure


def _moments(episode: Episode) -> dict[str, int]:
    """Step of each moment, by its name."""
    jump = episode.jump
    time = np.array([snapshot.time for snapshot in episode.trace])
    height = np.array([snapshot.com[2] for snapshot in episode.trace])
    last = len(time) - 1
    end = _ENDS.get(episode.outcome, "End")
    if math.isnan(jump["takeoff_time"]):
        return {"Crouch": 0, end: last}
    # Metrics know every physics step, a trace the control ticks: the first one at which the
    # soles are off the floor, or back on it.
    takeoff, impact = (
        min(int(np.searchsorted(time, event - 1e-9)), last)
        for event in (jump["takeoff_time"], jump["takeoff_time"] + jump["flight_time"])
    )
    apex = takeoff + int(np.argmax(height[takeoff : impact + 1]))
    return {"Crouch": 0, "Take-off": takeoff, "Apex": apex, "First impact": impact, end: last}
