"""What is measured of a jump, and what counts as a success."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from icub_jump_env.checks import check_flag, check_number, store


@dataclass(frozen=True)
class SuccessConfig:
    """What counts as a successful jump.

    Attributes:
        flight_time: Least time in the air (s).
        height_ratio: Least CoM rise in flight, as a share of the commanded height.
        stand_time: How long the robot must stand after touch-down (s).
        early_end: End an episode as soon as it is known whether the robot will stand
            (:mod:`icub_jump_env.metrics.foresight`); ``landed`` and the outcome are what is
            foreseen, and what is measured until the end ends there.

    Raises:
        ConfigError: If a value is out of range.
    """

    flight_time: float = 0.1
    height_ratio: float = 0.7
    stand_time: float = 2.0
    early_end: bool = False

    def __post_init__(self) -> None:
        store(self, flight_time=check_number("flight_time", self.flight_time, 0.0, 1.0, "s"))
        store(self, height_ratio=check_number("height_ratio", self.height_ratio, 0.0, 2.0))
        store(self, stand_time=check_number("stand_time", self.stand_time, 0.0, 30.0, "s"))
        store(self, early_end=check_flag("early_end", self.early_end))


class _Undefined(float):
    """A NaN that equals itself, so that equal results compare equal.

    ``math.isnan(x)`` and ``x != x`` still tell it from a number. Gymnasium's checker
    compares infos with ``==``, which no ordinary NaN survives.
    """

    def __eq__(self, other: object) -> bool:
        return isinstance(other, float) and math.isnan(other)

    def __hash__(self) -> int:
        return hash("undefined")  # that of a NaN depends on which one it is


UNDEFINED = _Undefined("nan")


@dataclass(slots=True)
class JumpMetrics:
    """Result of one jump, plain floats and bools in SI units; NaN where undefined.

    Attributes:
        takeoff_time: Last loss of ground contact before the apex, since the start of the jump
            (s).
        takeoff_velocity: Vertical CoM velocity then (m/s).
        ballistic_height: takeoff_velocity^2 / 2g (m).
        flight_time: Time from take-off to the first contact after the apex (s); 0
            without a flight.
        flight_height: Apex CoM height minus CoM height at take-off (m); 0 without a
            flight.
        apex_height: Largest CoM height in flight (m, above the floor).
        sole_height: Largest height in flight of the lower sole's lowest corner (m).
        flight_rotation: Rotation of the equivalent rigid body about +y: the locked
            angular velocity integrated over the flight (rad).
        base_pitch_range: Largest minus smallest base pitch in flight (rad).
        angular_momentum_takeoff: Angular momentum about the CoM at take-off, world
            axes (kg m^2/s).
        peak_ground_force: Largest vertical ground force of the jump (N).
        landing_force: Largest vertical ground force after touch-down (N).
        joint_work: Mechanical work of the joints, counted positive also where they brake
            (J).
        sole_slip: Largest horizontal way of a sole's centre on the ground (m), from where it
            stood at the start or at the last touch-down, while the chest is within 30 deg of
            upright. The way of a foot that is lifted alone counts, too.
        chest_lean: Forward and leftward lean of the chest at the end (rad), in the sagittal and
            the frontal plane.
        landed: Whether, ``stand_time`` after touch-down, only the feet have touched the
            ground and the chest is within 30 deg of upright. Where another jump follows: that
            long before the next crouch, which leans as far, and nothing else touched until its
            launch.
        solver_failures: Control ticks whose QP solution was not applied.
        limit_violations: Physics steps with a joint beyond 1.03 x its speed limit, or
            beyond its torque or position limit.
        self_collisions: Control ticks, but no more than 100 a second, at which links were in
            each other; neighbours at a joint do not count.
        still_time: How long the CoM has been slower than 0.05 m/s at the end (s).
    """

    takeoff_time: float = UNDEFINED
    takeoff_velocity: float = UNDEFINED
    ballistic_height: float = UNDEFINED
    flight_time: float = 0.0
    flight_height: float = 0.0
    apex_height: float = UNDEFINED
    sole_height: float = UNDEFINED
    flight_rotation: float = UNDEFINED
    base_pitch_range: float = UNDEFINED
    angular_momentum_takeoff: tuple[float, float, float] = (UNDEFINED, UNDEFINED, UNDEFINED)
    peak_ground_force: float = 0.0
    landing_force: float = UNDEFINED
    joint_work: float = 0.0
    sole_slip: float = 0.0
    chest_lean: tuple[float, float] = (0.0, 0.0)
    landed: bool = False
    solver_failures: float = 0.0
    limit_violations: float = 0.0
    self_collisions: float = 0.0
    still_time: float = 0.0

    def is_success(self, jump_height: float, success: SuccessConfig) -> bool:
        """Whether the jump to a commanded height (m) landed, high and long enough."""
        return (
            self.landed
            and self.flight_time >= success.flight_time
            and self.flight_height >= success.height_ratio * jump_height
        )

    def as_dict(self) -> dict[str, Any]:
        """The metrics by name."""
        return {name: getattr(self, name) for name in self.__slots__}
