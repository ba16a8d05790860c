"""The learned residual: a target offset of the CoM reference, smoothed into a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from icub_jump_env.checks import check_choice, check_number, check_numbers, store
from icub_jump_env.records import Array, Record, Vector

RESIDUAL_TIME = 0.7
"""How long a residual acts after the launch, where it does (s): a flight takes 0.2 s, and
after half a second on the ground most has happened."""

RESIDUAL_RANGE = (0.0, 0.10)

ResidualPhases = Literal["launch", "all"]


@dataclass(frozen=True)
class ResidualConfig:
    """How actions move the set point.

    Attributes:
        scale: Largest offset of the CoM reference that an action can ask for: forward,
            lateral, vertical (m).
        phases: When the residual acts: in the launch alone, where it moves the CoM
            reference, or in all phases; in flight and landing it moves the CoM over the soles,
            by the set point of feedback or else by the posture that does so over resting feet.
        bandwidth: Natural frequency (rad/s) of the filter that shapes it; with the default
            90 % of a step within 0.26 s.

    Raises:
        ConfigError: If a value is out of range.
    """

    scale: tuple[float, float, float] = (0.06, 0.02, 0.02)
    phases: ResidualPhases = "launch"
    bandwidth: float = 15.0

    def __post_init__(self) -> None:
        store(self, scale=check_numbers("scale", self.scale, 3, *RESIDUAL_RANGE, "m"))
        check_choice("phases", self.phases, get_args(ResidualPhases))
        store(
            self,
            bandwidth=check_number("bandwidth", self.bandwidth, 1.0, 1000.0, "rad/s"),
        )


class ResidualFilter(Record):
    """Critically damped second-order filter with exact steps.

    Turns a piecewise constant target offset (m) into an offset with consistent velocity
    and acceleration: the velocity is the derivative of the offset, exactly, also
    between ticks. From rest, a zero target keeps all three at exactly zero.

    Attributes:
        offset: (3,) m, world axes (forward, lateral, vertical).
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
    """

    offset: Vector
    velocity: Vector
    acceleration: Vector

    def __init__(self, bandwidth: float) -> None:
        super().__init__()
        self._bandwidth = bandwidth
        self._at_rest = True

    def reset(self) -> None:
        """Return to rest at zero."""
        self._at_rest = True
        self.offset[:] = 0.0
        self.velocity[:] = 0.0
        self.acceleration[:] = 0.0

    def step(self, target: Array, dt: float) -> None:
        """Advance by ``dt`` seconds towards ``target`` ((3,) m)."""
        goals = target.tolist()
        if self._at_rest and not any(goals):
            return
        self._at_rest = False
        w = self._bandwidth
        decay = math.exp(-w * dt)
        # Three numbers at each control tick: floats take a third of the time of arrays.
        now = zip(goals, self.offset.tolist(), self.velocity.tolist(), strict=True)
        for axis, (goal, offset, velocity) in enumerate(now):
            error = offset - goal
            slope = velocity + w * error
            error_next = (error + slope * dt) * decay
            velocity = slope * decay - w * error_next
            self.velocity[axis] = velocity
            self.offset[axis] = goal + error_next
            self.acceleration[axis] = -w * w * error_next - 2 * w * velocity
