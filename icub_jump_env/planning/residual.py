"""The learned residual: a target offset of the set point, smoothed into a motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

import numpy as np

from icub_jump_env.checks import check_choice, check_number, store
from icub_jump_env.errors import ConfigError
from icub_jump_env.records import Array, Record

RESIDUAL_TIME = 0.7
"""How long a residual acts after the launch, where it does (s): a flight takes 0.2 s, and
after half a second on the ground most has happened."""

AxisName = Literal["forward", "lateral", "vertical", "roll", "pitch"]

AXES: tuple[AxisName, ...] = get_args(AxisName)
"""What a residual can move: the CoM (m) along the world's axes, and its angular momentum about the
first two of them (kg m^2/s)."""

COM_AXES = AXES[:3]
"""Those of the default action."""

N_AXES = len(AXES)

RESIDUAL_RANGES = (*3 * ((0.0, 0.10, "m"),), *2 * ((0.0, 5.0, "kg m^2/s"),))
"""Range and unit of the scale of each axis."""

ResidualPhases = Literal["launch", "all"]


@dataclass(frozen=True)
class ResidualConfig:
    """How actions move the set point.

    Attributes:
        scale: What an action of 1 moves each of :data:`AXES` by, in their order (m, and
            kg m^2/s); those left out at the end keep the default.
        phases: When the residual acts: in the launch alone, where it moves the CoM
            reference, or in all phases; in flight and landing it moves the CoM over the soles,
            by the set point of feedback or else by the posture that does so over resting feet.
        bandwidth: Natural frequency (rad/s) of the filter that shapes it; with the default
            90 % of a step within 0.26 s.
        axes: What an action moves, in this order: some of :data:`AXES`. The angular momentum is
            that of the launch.

    Raises:
        ConfigError: If a value is out of range.
    """

    scale: tuple[float, ...] = (0.06, 0.02, 0.02, 1.0, 1.5)
    phases: ResidualPhases = "launch"
    bandwidth: float = 15.0
    axes: tuple[AxisName, ...] = COM_AXES

    def __post_init__(self) -> None:
        store(self, axes=check_axes(self.axes), scale=_check_scale(self.scale))
        check_choice("phases", self.phases, get_args(ResidualPhases))
        store(
            self,
            bandwidth=check_number("bandwidth", self.bandwidth, 1.0, 1000.0, "rad/s"),
        )

    @property
    def matrix(self) -> Array:
        """(5, n) target offsets of :data:`AXES` (m; kg m^2/s) for an action (n,)."""
        rows = [AXES.index(axis) for axis in self.axes]
        return np.diag(self.scale)[:, rows]


def check_axes(axes: Any, among: Sequence[str] = AXES) -> tuple[AxisName, ...]:
    """Refuse anything but some of the axes, in their order."""
    listed = isinstance(axes, list | tuple) and len(axes) > 0
    if not listed or list(axes) != [axis for axis in among if axis in axes]:
        raise ConfigError("axes", axes, f"some of {', '.join(among)}, in this order")
    return tuple(axes)


def _check_scale(scale: Any) -> tuple[float, ...]:
    allowed = ", ".join(
        f"{axis} from {low:g} to {high:g} {unit}"
        for axis, (low, high, unit) in zip(AXES, RESIDUAL_RANGES, strict=True)
    )
    refusal = ConfigError("scale", scale, f"{allowed}; the last two may be left out")
    listed = isinstance(scale, Sequence) or (isinstance(scale, np.ndarray) and scale.ndim == 1)
    if not listed or not len(COM_AXES) <= len(scale) <= N_AXES:
        raise refusal
    whole = (*scale, *ResidualConfig.scale[len(scale) :])
    try:
        return tuple(
            check_number("scale", value, low, high)
            for value, (low, high, _) in zip(whole, RESIDUAL_RANGES, strict=True)
        )
    except ConfigError:
        raise refusal from None


class ResidualFilter(Record):
    """Critically damped second-order filter with exact steps.

    Turns a piecewise constant target offset into an offset with consistent velocity and
    acceleration: the velocity is the derivative of the offset, exactly, also between ticks.
    From rest, a zero target keeps all three at exactly zero.

    Attributes:
        offset: (5,) of each of :data:`AXES`, world axes (m; kg m^2/s).
        velocity: (5,) its rate (m/s; Nm).
        acceleration: (5,) the rate of that (m/s^2; Nm/s).
    """

    offset: Annotated[Array, (N_AXES,)]
    velocity: Annotated[Array, (N_AXES,)]
    acceleration: Annotated[Array, (N_AXES,)]

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
        """Advance by ``dt`` seconds towards ``target``, (5,)."""
        goals = target.tolist()
        if self._at_rest and not any(goals):
            return
        self._at_rest = False
        w = self._bandwidth
        decay = math.exp(-w * dt)
        # Few numbers at each control tick: floats take a third of the time of arrays.
        now = zip(goals, self.offset.tolist(), self.velocity.tolist(), strict=True)
        for axis, (goal, offset, velocity) in enumerate(now):
            if goal == offset == velocity == 0.0:
                continue
            error = offset - goal
            slope = velocity + w * error
            error_next = (error + slope * dt) * decay
            velocity = slope * decay - w * error_next
            self.velocity[axis] = velocity
            self.offset[axis] = goal + error_next
            self.acceleration[axis] = -w * w * error_next - 2 * w * velocity
