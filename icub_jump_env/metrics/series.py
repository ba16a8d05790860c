"""The jumps of an episode, one after the other: the metrics of each, and what they say together."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.metrics.foresight import foresee
from icub_jump_env.metrics.jump import JumpMetrics, SuccessConfig
from icub_jump_env.metrics.recorder import AIRBORNE_FORCE, JumpRecorder, has_stood
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.records import Array, Block, Number, Record
from icub_jump_env.robot.limits import JointLimits

FALLEN_TILT = math.radians(60.0)
"""Chest tilt (rad) beyond which the robot has fallen."""

TAKEOFF_GRACE = 0.5
"""Time after T (s) within which the robot must have left the ground."""


NEXT_GRACE = 3.0
"""Time after touch-down (s) within which the next jump, if there is one, must have begun."""

RUNNING, FELL, STOOD, NO_TAKEOFF = range(4)
OUTCOMES = ("running", "fell", "stood", "no take-off")
"""What these numbers, which :func:`judge` returns, are called."""


class Rules(Record):
    """What :func:`judge` goes by.

    Attributes:
        takeoff_time: T of the present jump (s).
        is_last: Whether no jump follows: 0 or 1.
        foreseen_from: From when on the outcome may be foreseen (s of the jump).
        last_push: When the last push so far ends (s of the episode).
    """

    takeoff_time: Number
    is_last: Number
    foreseen_from: Number
    last_push: Number


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
        ended: The jumps that are over.
        rules: When the episode is over.
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
        self.rules = Rules()
        self._heights: list[float] = []
        self.ended: list[Jump] = []
        self._start = np.zeros(2)

    def reset(self) -> None:
        """An episode begins."""
        self._heights, self.ended = [], []
        self.rules.last_push = 0.0

    @property
    def begun(self) -> int:
        """How many jumps have begun."""
        return len(self._heights)

    @property
    def jumps(self) -> list[Jump]:
        """All jumps that have begun; the last one is as it is now."""
        return [*self.ended, Jump(self.height, self.present.metrics)]

    @property
    def height(self) -> float:
        """Command of the present jump (m)."""
        return self._heights[-1]

    def begin(
        self,
        height: float,
        takeoff_time: float,
        state: TrueState,
        time: float,
        rest: float | None,
        foreseen_from: float,
    ) -> None:
        """A jump begins, and the one before is over.

        Args:
            height: Commanded height (m).
            takeoff_time: T of its plan (s).
            state: The true state.
            time: Time since the start of the episode (s).
            rest: How long the robot stands before the next crouch (s); ``None`` in the last
                jump.
            foreseen_from: From when on the outcome of the last jump may be foreseen (s of the
                jump); infinity if it never is.
        """
        if self._heights:
            self.present.conclude()
            self.ended.append(Jump(self.height, self.present.metrics))
        else:
            self._start[:] = _between_the_feet(state)
        self._heights.append(height)
        self.present.reset(time, rest)
        rules = self.rules
        rules.takeoff_time, rules.is_last = takeoff_time, float(self.is_last)
        rules.foreseen_from = foreseen_from if self.is_last else math.inf

    @property
    def blocks(self) -> tuple[Block, Block, Block]:
        """What watches and judges a physics step: limits, rules and record."""
        present = self.present
        return present.limits.block, self.rules.block, present.record.block

    @property
    def is_last(self) -> bool:
        """Whether no jump follows."""
        return len(self._heights) == self._total

    @property
    def is_success(self) -> bool:
        """Whether each jump was a success, and there were all."""
        # The metrics take time to gather, and in most steps this says enough.
        if not (self.is_last and self.present.record.landed):
            return False
        return all(jump.metrics.is_success(jump.height, self._success) for jump in self.jumps)

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


@compiled
def judge(state: Block, rules: Block, record: Block) -> int:
    """The number of the episode's outcome in the true state; :data:`OUTCOMES` has its name.

    Args:
        state: Block of the :class:`icub_jump_env.metrics.state.TrueState`.
        rules: Block of the :class:`Rules`.
        record: Block of what the :class:`icub_jump_env.metrics.recorder.JumpRecorder` has.
    """
    s, r, jump = state[0], rules[0], record[0]
    tilt = math.acos(min(1.0, max(-1.0, s.chest_up[2])))
    if not s.only_feet_touch or tilt > FALLEN_TILT:
        return FELL
    if r.is_last and has_stood(jump):
        return STOOD
    time = s.time - jump.start
    if r.foreseen_from < math.inf:
        verdict = foresee(s, time, jump)
        if verdict != 0 and time >= r.foreseen_from and s.time >= r.last_push:
            jump.landed = 1.0 if verdict > 0 else 0.0
            return STOOD if verdict > 0 else FELL
    airborne = s.ground_force < AIRBORNE_FORCE
    late = time >= r.takeoff_time + TAKEOFF_GRACE
    if late and not airborne and math.isnan(jump.takeoff_time):
        return NO_TAKEOFF
    # A robot that does not notice its landing waits for it.
    if not r.is_last and time - jump.touchdown_time >= NEXT_GRACE:
        return NO_TAKEOFF
    return RUNNING
