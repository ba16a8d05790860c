"""Jump metrics from the true state, updated at every physics step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number, store
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.robot.icub import GRAVITY, SPEED_TOLERANCE

Array = NDArray[np.float64]

AIRBORNE_FORCE = 1.0
"""The robot is airborne while the ground carries less than this (N)."""
LANDED_TILT = math.radians(30.0)
"""A landed robot keeps its chest within this tilt (rad)."""
POSITION_TOLERANCE = 1e-3
"""... and its position limit beyond this (rad): MuJoCo's limits are slightly soft."""
CHATTER_TIME = 0.02
"""A shorter loss of ground contact is no flight (s)."""


@dataclass(frozen=True)
class SuccessConfig:
    """What counts as a successful jump.

    Attributes:
        flight_time: Least time in the air (s).
        height_ratio: Least CoM rise in flight, as a share of the commanded height.
        stand_time: How long the robot must stand after touch-down (s).

    Raises:
        ConfigError: If a value is out of range.
    """

    flight_time: float = 0.1
    height_ratio: float = 0.7
    stand_time: float = 2.0

    def __post_init__(self) -> None:
        store(self, flight_time=check_number("flight_time", self.flight_time, 0.0, 1.0, "s"))
        store(self, height_ratio=check_number("height_ratio", self.height_ratio, 0.0, 2.0))
        store(self, stand_time=check_number("stand_time", self.stand_time, 0.0, 30.0, "s"))


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


@dataclass(frozen=True)
class JointLimits:
    """Limits whose violations are counted, (n,) arrays in SI units."""

    lower_position: Array
    upper_position: Array
    speed: Array
    torque: Array


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


@dataclass(slots=True)
class Flight:
    """One spell in the air, SI units.

    Attributes:
        time: Loss of ground contact (s).
        height: CoM height then (m).
        velocity: Vertical CoM velocity then (m/s).
        momentum: Angular momentum about the CoM then, world axes (kg m^2/s).
        duration: Time in the air (s); while it lasts, so far.
        apex: Largest CoM height (m).
        sole: Largest height of the lower sole's lowest corner (m).
        rotation: Rotation of the equivalent rigid body about +y (rad).
        pitch_low, pitch_high: Extremes of the base pitch (rad).
    """

    time: float
    height: float
    velocity: float
    momentum: tuple[float, float, float]
    duration: float = 0.0
    apex: float = -math.inf
    sole: float = -math.inf
    rotation: float = 0.0
    pitch_low: float = math.inf
    pitch_high: float = -math.inf


class JumpRecorder:
    """Watches the true state and keeps the metrics of the jump up to date.

    The flight that counts is the one with the highest apex among those of at least 20 ms,
    so that neither chatter before take-off nor a bounce after landing is taken for it.

    Attributes:
        metrics: The metrics so far; of the flights, those of the highest one.
        flights: All flights of at least 20 ms so far, in time.
        touchdown_time: First contact after the apex (s); NaN before.

    Times are those since the start of the jump.
    """

    def __init__(self, limits: JointLimits, stand_time: float) -> None:
        """Start recording.

        Args:
            limits: Joint limits to watch.
            stand_time: Time (s) to stand after touch-down.
        """
        self._limits = limits
        self._speed = limits.speed * (1 + SPEED_TOLERANCE)
        self._lower = limits.lower_position - POSITION_TOLERANCE
        self._upper = limits.upper_position + POSITION_TOLERANCE
        self._torque = limits.torque * (1 + 1e-9)
        self._stand_time = stand_time
        self.reset()

    def reset(self, start: float = 0.0, rest: float | None = None) -> None:
        """Forget everything; a jump begins.

        Args:
            start: Time since the start of the episode (s).
            rest: Instead of ``stand_time``, if another jump follows (s).
        """
        self.metrics = JumpMetrics()
        self._start, self._rest, self._has_landed = start, rest, False
        self.touchdown_time = math.nan
        self.flights: list[Flight] = []
        self._flight: Flight | None = None
        self._best_apex = -math.inf
        self._last_time: float | None = None
        self._only_feet = True
        self._footholds: tuple[list[float], ...] | None = None

    @property
    def stood(self) -> bool:
        """Whether ``stand_time`` has passed since touch-down, or the rest."""
        least = self._stand_time if self._rest is None else self._rest
        return bool(
            self._last_time is not None and (self._last_time - self.touchdown_time >= least - 1e-9)
        )

    def update(self, state: TrueState) -> None:
        """Take in the true state of one physics step."""
        metrics, time = self.metrics, state.time - self._start
        dt = 0.0 if self._last_time is None else time - self._last_time
        self._last_time = time
        if state.ground_force > metrics.peak_ground_force:
            metrics.peak_ground_force = state.ground_force
        self._only_feet = self._only_feet and state.only_feet_touch
        speed, torque = np.abs(state.joint_velocity), np.abs(state.joint_torque)
        metrics.joint_work += float(speed @ torque) * dt
        if self._violates(state, speed, torque):
            metrics.limit_violations += 1.0

        upright = state.chest_tilt < LANDED_TILT
        if state.ground_force < AIRBORNE_FORCE:
            if self._flight is None:
                self._flight = _take_off(state, time)
            self._fly(self._flight, state, time, dt)
        elif self._flight is not None:
            self._touch_down(self._flight, time)
        elif upright:
            self._slip(state)
        if time >= self.touchdown_time:
            metrics.landing_force = max(metrics.landing_force, state.ground_force)
        x, y, z = state.chest_up
        metrics.chest_lean = math.atan2(x, z), math.atan2(y, z)
        metrics.landed = self._only_feet and self.stood and upright
        self._has_landed = self._has_landed or metrics.landed

    def conclude(self) -> None:
        """Another jump begins: who stood upright and has not fallen since has landed."""
        self.metrics.landed = self._has_landed and self._only_feet

    def _slip(self, state: TrueState) -> None:
        if self._footholds is None:
            self._footholds = tuple(sole.tolist() for sole in state.sole_position)
        for sole, foothold in zip(state.sole_position, self._footholds, strict=True):
            way = math.hypot(sole[0] - foothold[0], sole[1] - foothold[1])
            if way > self.metrics.sole_slip:
                self.metrics.sole_slip = way

    def _violates(self, state: TrueState, speed: Array, torque: Array) -> bool:
        return bool(
            (speed > self._speed).any()
            or (torque > self._torque).any()
            or (state.joint_position < self._lower).any()
            or (state.joint_position > self._upper).any()
        )

    def _fly(self, flight: Flight, state: TrueState, time: float, dt: float) -> None:
        locked_velocity = np.linalg.solve(state.locked_inertia, state.angular_momentum)
        flight.rotation += float(locked_velocity[1]) * dt
        flight.duration = time - flight.time
        flight.apex = max(flight.apex, float(state.com[2]))
        flight.sole = max(flight.sole, state.sole_height)
        flight.pitch_low = min(flight.pitch_low, state.base_pitch)
        flight.pitch_high = max(flight.pitch_high, state.base_pitch)
        if flight.duration < CHATTER_TIME:
            return
        if not self.flights or self.flights[-1] is not flight:
            self.flights.append(flight)
        if flight.apex >= self._best_apex:
            self._best_apex = flight.apex
            self.touchdown_time = math.nan
            self._publish(flight)

    def _publish(self, flight: Flight) -> None:
        metrics = self.metrics
        metrics.takeoff_time = flight.time
        metrics.takeoff_velocity = flight.velocity
        metrics.ballistic_height = flight.velocity**2 / (2 * GRAVITY)
        metrics.flight_time = flight.duration
        metrics.flight_height = flight.apex - flight.height
        metrics.apex_height = flight.apex
        metrics.sole_height = flight.sole
        metrics.flight_rotation = flight.rotation
        metrics.base_pitch_range = flight.pitch_high - flight.pitch_low
        metrics.angular_momentum_takeoff = flight.momentum
        metrics.landing_force = UNDEFINED

    def _touch_down(self, flight: Flight, time: float) -> None:
        if flight.duration >= CHATTER_TIME and flight.apex >= self._best_apex:
            flight.duration = time - flight.time
            self.metrics.flight_time = flight.duration
            self.metrics.landing_force = 0.0
            self.touchdown_time = time
        self._footholds = None
        self._flight = None


def _take_off(state: TrueState, time: float) -> Flight:
    x, y, z = (float(h) for h in state.angular_momentum)
    return Flight(
        time=time,
        height=float(state.com[2]),
        velocity=float(state.com_velocity[2]),
        momentum=(x, y, z),
    )
