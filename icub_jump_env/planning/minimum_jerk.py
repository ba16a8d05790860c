"""Minimum-jerk joint trajectories of the flight phase (paper section III-C)."""

from __future__ import annotations

from typing import Any

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array

PEAK_SPEED = 1.875
"""Largest speed of the motion, in way per duration."""


@compiled
def progress(u: Any) -> tuple[Any, Any]:
    """Share of the way, and its derivative, at a share ``u`` of the duration."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2


class MinimumJerk:
    """Minimum-jerk motion from rest to rest; after its duration it stays at the goal.

    Also after a moving take-off the motion starts at rest: stopping the legs at once is
    what takes the feet off the ground. Continuing the joint velocities instead would keep
    them on the ground while gravity slows the robot down.
    """

    def __init__(self, start: Array, goal: Array, duration: float) -> None:
        """Plan the motion.

        Args:
            start: (n,) initial positions (rad).
            goal: (n,) final positions (rad).
            duration: Time to the goal (s).
        """
        self._start = start
        self._path = goal - start
        self._duration = duration

    def sample(self, time: float) -> tuple[Array, Array]:
        """Position (rad) and velocity (rad/s) at ``time`` (s) after the start."""
        sampled: tuple[Array, Array] = sample(time, self._duration, self._start, self._path)
        return sampled


@compiled
def sample(time: float, duration: float, start: Array, path: Array) -> tuple[Array, Array]:
    """Position and velocity ``time`` after the start, along a ``path`` of a ``duration``."""
    done, rate = progress(min(max(time / duration, 0.0), 1.0))
    return start + done * path, rate / duration * path
