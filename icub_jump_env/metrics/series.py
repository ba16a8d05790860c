"""The jumps of an episode, one after the other: the metrics of each, and what they say together."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.metrics.jump import (
    AIRBORNE_FORCE,
    JointLimits,
    JumpMetrics,
    JumpRecorder,
    SuccessConfig,
)
from icub_jump_env.metrics.state import TrueState

Array = NDArray[np.float64]

FALLEN_TILT = math.radians(60.0)
"""Chest tilt (rad) beyond which the robot has fallen."""

TAKEOFF_GRACE = 0.5
"""Time after T (s) within which the robot must have left the ground."""


NEXT_GRACE = 3.0
"""Time after touch-down (s) within which the next jump, if there is one, must have begun."""


class Jump(NamedTuple):
    """One jump of a series.

    Attributes:
        height: Commanded height (m).
        metrics: Its metrics, so far.
    """

    height: float
    metrics: JumpMetrics


class SeriesRecorder:
    """Watches an episode of some jumps.

    Attributes:
        present: Watches the latest jump.
        jumps: All that have begun.
    """

    def __init__(self, total: int, limits: JointLimits, success: SuccessConfig) -> None:
        """Set up the recorder.

        Args:
            total: How many jumps there are to be.
            limits: Joint limits to watch.
            success: What counts as a successful jump.
        """
        self._total = total
        self.present = JumpRecorder(limits, success.stand_time)
        self._success = success
        self.jumps: list[Jump] = []
        self._start = np.zeros(2)
        self._began = 0.0

    def reset(self) -> None:
        """An episode begins."""
        self.jumps = []

    def begin(self, height: float, state: TrueState, time: float, rest: float | None) -> None:
        """A jump begins, and the one before is over.

        Args:
            height: Commanded height (m).
            state: The true state.
            time: Time since the start of the episode (s).
            rest: How long the robot stands before the next crouch (s); ``None`` in the last
                jump.
        """
        if self.jumps:
            self.present.conclude()
        else:
            self._start[:] = _between_the_feet(state)
        self._began = time
        self.present.reset(time, rest)
        self.jumps.append(Jump(height, self.present.metrics))

    def judge(self, state: TrueState, duration: float) -> str:
        """The outcome of the episode; while it goes on, ``running``.

        Args:
            state: The true state.
            duration: Take-off time T of the present jump (s).
        """
        if not state.only_feet_touch or state.chest_tilt > FALLEN_TILT:
            return "fell"
        if self.is_last and self.present.stood:
            return "stood"
        time, touchdown = state.time - self._began, self.present.touchdown_time
        airborne = state.ground_force < AIRBORNE_FORCE
        if (
            time >= duration + TAKEOFF_GRACE
            and not airborne
            and math.isnan(self.present.metrics.takeoff_time)
        ):
            return "no take-off"
        # A robot that does not notice its landing waits for it.
        if not self.is_last and time - touchdown >= NEXT_GRACE:
            return "no take-off"
        return "running"

    @property
    def is_last(self) -> bool:
        """Whether no jump follows."""
        return len(self.jumps) == self._total

    @property
    def is_success(self) -> bool:
        """Whether each jump was a success, and there were all."""
        return self.is_last and all(
            jump.metrics.is_success(jump.height, self._success) for jump in self.jumps
        )

    def as_dict(self, state: TrueState) -> dict[str, Any]:
        """What the jumps that have begun say together, in the true ``state`` of now.

        Returns:
            ``jumps``: how many have begun; ``jump_heights``: their commands (m); ``landed``: in a
            row from the first; ``mean_flight_height`` and ``min_flight_height`` (m); ``drift``:
            way of the middle of the soles since the start, forward and left (m); and
            ``landing_force``: the largest (N), NaN before any.
        """
        metrics = [jump.metrics for jump in self.jumps]
        landed = [m.landed for m in metrics]
        heights = [m.flight_height for m in metrics]
        forward, left = (_between_the_feet(state) - self._start).tolist()
        largest = metrics[0].landing_force
        for m in metrics[1:]:
            largest = max(largest, m.landing_force)  # NaN in the present jump does not count
        return {
            "jumps": len(metrics),
            "jump_heights": tuple(jump.height for jump in self.jumps),
            "landed": [*landed, False].index(False),
            "mean_flight_height": sum(heights) / len(heights),
            "min_flight_height": min(heights),
            "drift": (forward, left),
            "landing_force": largest,
        }


def _between_the_feet(state: TrueState) -> Array:
    left, right = state.sole_position
    middle: Array = (left[:2] + right[:2]) / 2
    return middle
