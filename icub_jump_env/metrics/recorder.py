"""Jump metrics from the true state, updated at every physics step."""

from __future__ import annotations

import math
from typing import Annotated, Any

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import cholesky, solve, solve_transposed
from icub_jump_env.metrics.jump import UNDEFINED, JumpMetrics
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.records import Array, Block, Number, Record, Vector
from icub_jump_env.robot.icub import GRAVITY, SPEED_TOLERANCE
from icub_jump_env.robot.limits import JointLimits

AIRBORNE_FORCE = 1.0
"""The robot is airborne while the ground carries less than this (N)."""
LANDED_TILT = math.radians(30.0)
"""A landed robot keeps its chest within this tilt (rad)."""
POSITION_TOLERANCE = 1e-3
"""A joint violates its position limit beyond this (rad): MuJoCo's limits are slightly soft."""
CHATTER_TIME = 0.02
"""A shorter loss of ground contact is no flight (s)."""
STILL_SPEED = 0.05
"""The robot is still while its CoM is slower than this (m/s)."""


class JumpRecord(Record):
    """The metrics of a jump so far, and what they are made of; flags are 0 or 1.

    Attributes:
        takeoff_time, and all until still_time: As in
            :class:`icub_jump_env.metrics.jump.JumpMetrics`.
        start: When the jump began (s of the episode).
        rest: How long the robot has to stand after touch-down (s).
        last_time: Of the latest state, since the start (s); NaN before.
        touchdown_time: First contact after the apex, since the start (s); NaN before.
        best_apex: Largest CoM height of all flights so far (m).
        only_feet: Whether nothing but the soles has touched the ground.
        has_landed: Whether the robot stood long enough at some time.
        has_footholds: Whether it is known where the soles stood.
        footholds: (2, 2) where they did, forward and left (m).
        restless: When the robot was last not calm, since the start (s).
        flying: Whether a spell in the air goes on; of it are all that follow.
        flight_start: Loss of ground contact, since the start (s).
        flight_start_height: CoM height then (m).
        flight_velocity: Vertical CoM velocity then (m/s).
        flight_momentum: (3,) angular momentum about the CoM then (kg m^2/s).
        flight_duration: Time in the air so far (s).
        flight_apex: Largest CoM height (m).
        flight_sole: Largest height of the lower sole's lowest corner (m).
        flight_turn: Rotation of the equivalent rigid body about +y (rad).
        pitch_low, pitch_high: Extremes of the base pitch (rad).
    """

    takeoff_time: Number
    takeoff_velocity: Number
    ballistic_height: Number
    flight_time: Number
    flight_height: Number
    apex_height: Number
    sole_height: Number
    flight_rotation: Number
    base_pitch_range: Number
    angular_momentum_takeoff: Vector
    peak_ground_force: Number
    landing_force: Number
    joint_work: Number
    sole_slip: Number
    chest_lean: Annotated[Array, (2,)]
    landed: Number
    solver_failures: Number
    limit_violations: Number
    self_collisions: Number
    still_time: Number
    start: Number
    rest: Number
    last_time: Number
    touchdown_time: Number
    best_apex: Number
    only_feet: Number
    has_landed: Number
    has_footholds: Number
    footholds: Annotated[Array, (2, 2)]
    restless: Number
    flying: Number
    flight_start: Number
    flight_start_height: Number
    flight_velocity: Number
    flight_momentum: Vector
    flight_duration: Number
    flight_apex: Number
    flight_sole: Number
    flight_turn: Number
    pitch_low: Number
    pitch_high: Number


class JumpRecorder:
    """Watches the true state and keeps the metrics of the jump up to date.

    The flight that counts is the one with the highest apex among those of at least 20 ms,
    so that neither chatter before take-off nor a bounce after landing is taken for it.

    Attributes:
        record: The metrics, and what they are made of.
        limits: Joint limits beyond which a joint violates them.
    """

    def __init__(self, limits: JointLimits, stand_time: float) -> None:
        """Start recording.

        Args:
            limits: Joint limits to watch.
            stand_time: Time (s) to stand after touch-down.
        """
        self.record = JumpRecord()
        self.limits = JointLimits(
            {"n": len(limits.speed)},
            lower=limits.lower - POSITION_TOLERANCE,
            upper=limits.upper + POSITION_TOLERANCE,
            speed=limits.speed * (1 + SPEED_TOLERANCE),
            torque=limits.torque * (1 + 1e-9),
        )
        self._stand_time = stand_time
        self.reset()

    def reset(self, start: float = 0.0, rest: float | None = None) -> None:
        """Forget everything; a jump begins.

        Args:
            start: Time since the start of the episode (s).
            rest: Instead of ``stand_time``, if another jump follows (s).
        """
        begin(start, self._stand_time if rest is None else rest, self.record.block)

    @property
    def metrics(self) -> JumpMetrics:
        """The metrics so far; of the flights, those of the highest one."""
        found = self.record.block[0].item()[: len(JumpMetrics.__slots__)]
        plain = [
            (value if value == value else UNDEFINED)
            if isinstance(value, float)
            else tuple(map(_plain, value.tolist()))
            for value in found
        ]
        values: dict[str, Any] = dict(zip(JumpMetrics.__slots__, plain, strict=True))
        values["landed"] = bool(values["landed"])
        return JumpMetrics(**values)

    @property
    def touchdown_time(self) -> float:
        """First contact after the apex, since the start of the jump (s); NaN before."""
        return self.record.touchdown_time

    def update(self, state: TrueState) -> None:
        """Take in the true state of one physics step."""
        watch(state.block, self.limits.block, self.record.block)

    def conclude(self) -> None:
        """Another jump begins: who stood upright and has not fallen since has landed."""
        self.record.landed = self.record.has_landed * self.record.only_feet


def _plain(value: float) -> float:
    return value if value == value else UNDEFINED


@compiled
def begin(start: float, rest: float, record: Block) -> None:
    """Forget everything; arguments as of :meth:`JumpRecorder.reset`, and the block."""
    r = record[0]
    r.flight_time = r.flight_height = 0.0
    r.takeoff_time = r.takeoff_velocity = r.ballistic_height = math.nan
    r.apex_height = r.sole_height = r.flight_rotation = r.base_pitch_range = math.nan
    r.angular_momentum_takeoff[:] = math.nan
    r.peak_ground_force = r.joint_work = r.sole_slip = r.landed = 0.0
    r.solver_failures = r.limit_violations = r.self_collisions = r.still_time = 0.0
    r.chest_lean[:] = 0.0
    r.start, r.rest = start, rest
    r.landing_force = r.last_time = r.touchdown_time = math.nan
    r.best_apex = -math.inf
    r.only_feet, r.restless = 1.0, 0.0
    r.has_landed = r.has_footholds = r.flying = 0.0


@compiled
def has_stood(record: Block) -> bool:
    """Whether ``stand_time``, or the rest, has passed since touch-down."""
    stands: bool = record.last_time - record.touchdown_time >= record.rest - 1e-9
    return stands


@compiled
def watch(state: Block, limits: Block, record: Block) -> None:
    """Take in the true state of one physics step.

    Args:
        state: Block of the :class:`icub_jump_env.metrics.state.TrueState`.
        limits: Block of the limits beyond which a joint violates them.
        record: Block of the :class:`JumpRecord`.
    """
    s, bounds, r = state[0], limits[0], record[0]
    time, force = s.time - r.start, s.ground_force
    dt = 0.0 if math.isnan(r.last_time) else time - r.last_time
    r.last_time = time
    r.peak_ground_force = max(r.peak_ground_force, force)
    r.only_feet = r.only_feet * s.only_feet_touch
    watch_joints(s, dt, bounds, r)
    v = s.com_velocity
    slow = v[0] ** 2 + v[1] ** 2 + v[2] ** 2 < STILL_SPEED**2
    r.still_time = r.still_time + dt if slow else 0.0

    x, y, z = s.chest_up[0], s.chest_up[1], s.chest_up[2]
    upright = math.acos(min(1.0, max(-1.0, z))) < LANDED_TILT
    if force < AIRBORNE_FORCE:
        if not r.flying:
            take_off(s, time, r)
        fly(s, time, dt, r)
    elif r.flying:
        touch_down(time, r)
    elif upright:
        slip(s, r)
    if time >= r.touchdown_time:
        r.landing_force = max(r.landing_force, force)
    r.chest_lean[0], r.chest_lean[1] = math.atan2(x, z), math.atan2(y, z)
    r.landed = 1.0 if r.only_feet and has_stood(r) and upright else 0.0
    r.has_landed = max(r.has_landed, r.landed)


@compiled
def watch_joints(state: Block, dt: float, limits: Block, record: Block) -> None:
    """Work of the joints in a step of ``dt`` (s), and whether one violates a limit."""
    work, violated = 0.0, False
    for j in range(state.joint_position.shape[0]):
        position = state.joint_position[j]
        speed, torque = abs(state.joint_velocity[j]), abs(state.joint_torque[j])
        work += speed * torque
        violated = (
            violated
            or speed > limits.speed[j]
            or torque > limits.torque[j]
            or position < limits.lower[j]
            or position > limits.upper[j]
        )
    record.joint_work += work * dt
    if violated:
        record.limit_violations += 1.0


@compiled
def take_off(state: Block, time: float, record: Block) -> None:
    """A spell in the air begins."""
    record.flying = 1.0
    record.flight_start = time
    record.flight_start_height = state.com[2]
    record.flight_velocity = state.com_velocity[2]
    record.flight_momentum[:] = state.angular_momentum
    record.flight_duration = record.flight_turn = 0.0
    record.flight_apex = record.flight_sole = record.pitch_high = -math.inf
    record.pitch_low = math.inf


@compiled
def fly(state: Block, time: float, dt: float, record: Block) -> None:
    """It goes on; from 20 ms on, and as long as it is the highest one, the metrics are its own."""
    locked, velocity = state.locked_inertia.copy(), state.angular_momentum.copy()
    cholesky(locked, locked)
    solve_transposed(locked, velocity)
    solve(locked, velocity)
    r = record
    r.flight_turn += velocity[1] * dt
    r.flight_duration = time - r.flight_start
    r.flight_apex = max(r.flight_apex, state.com[2])
    r.flight_sole = max(r.flight_sole, state.sole_height)
    r.pitch_low = min(r.pitch_low, state.base_pitch)
    r.pitch_high = max(r.pitch_high, state.base_pitch)
    if r.flight_duration < CHATTER_TIME or r.flight_apex < r.best_apex:
        return
    r.best_apex = r.apex_height = r.flight_apex
    r.touchdown_time = r.landing_force = math.nan
    r.takeoff_time = r.flight_start
    r.takeoff_velocity = r.flight_velocity
    r.ballistic_height = r.flight_velocity**2 / (2 * GRAVITY)
    r.flight_time = r.flight_duration
    r.flight_height = r.flight_apex - r.flight_start_height
    r.sole_height = r.flight_sole
    r.flight_rotation = r.flight_turn
    r.base_pitch_range = r.pitch_high - r.pitch_low
    r.angular_momentum_takeoff[:] = r.flight_momentum


@compiled
def touch_down(time: float, record: Block) -> None:
    """It ends."""
    r = record
    if r.flight_duration >= CHATTER_TIME and r.flight_apex >= r.best_apex:
        r.flight_time = time - r.flight_start
        r.landing_force = 0.0
        r.touchdown_time = time
    r.has_footholds = r.flying = 0.0


@compiled
def slip(state: Block, record: Block) -> None:
    """How far the soles are from where they stood."""
    if not record.has_footholds:
        record.has_footholds = 1.0
        record.footholds[:] = state.sole_position[:, :2]
    for foot in range(2):
        way = math.hypot(
            state.sole_position[foot, 0] - record.footholds[foot, 0],
            state.sole_position[foot, 1] - record.footholds[foot, 1],
        )
        record.sole_slip = max(record.sole_slip, way)
