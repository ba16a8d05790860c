"""Flight: minimum jerk to the landing posture (paper section III-C), or feedback to the soles."""

from __future__ import annotations

import math
from typing import Annotated, Protocol

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.phases import PhaseController, Tick
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.linear_algebra import multiply, rotate, rotate_back, rotation_of
from icub_jump_env.planning.minimum_jerk import MinimumJerk, progress
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.records import Array, Block, Number, PerJoint, Record, Rotation, Vector
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.soles import LegKinematics

LEAD = 0.02
"""How far ahead the attitude is predicted (s)."""
LAG = 0.01
"""How far ahead positions are commanded (s): half of it is the servos', half computation."""
MOMENTUM_SHARE = 0.5
"""How much of the angular momentum becomes speed of the CoM at touch-down."""
PLACEMENT_TIME = 0.015
"""Time constant of the filter on the placement (s)."""
FARTHEST = 0.09, 0.03
"""Largest placement of the soles, forward and lateral (m)."""
SPEED_SHARE = 0.95
"""Share of the speed limits that corrections, and commands, use."""
EXTENSION, EXTENSION_TIME = 0.03, 0.05
"""How far (m) the legs reach for the ground, and how long that takes (s)."""
OVERSHOOT_TIME = 0.01
"""How long they wait then (s), because no torque turns the knees around at once."""
CALM_PLACEMENT, CALM_MOMENTUM = 0.02, 0.3
"""They wait where soles need no farther placement (m) and the robot turns with no more momentum
(kg m^2/s): it lands softer, but then stands lower, and is harder to catch."""
YIELD_TIME, YIELD_SHARE, FARTHEST_YIELD = 0.06, 0.8, 0.04
"""How long before touch-down the legs begin to give way (s), up to which share of the speed of
the fall, and how far (m) if the ground does not come."""
FARTHEST_BACK = 0.02
"""Soles placed further back than this (m) do not give way: a bent ankle would be at its limit."""


class Flight(PhaseController, Protocol):
    """A flight, from which a landing goes on.

    Attributes:
        command: The latest command.
    """

    command: JointCommand

    @property
    def yielding(self) -> float:
        """Speed at which the legs give way (m/s)."""
        ...

    def go_on(self, time: float, residual_target: Array) -> Tick:
        """After touch-down: the motion goes on to its end, without feedback."""
        ...

    def move_to(self, posture: Array, time: float, duration: float) -> None:
        """After touch-down: :meth:`go_on` moves to another posture from ``time`` on.

        Args:
            posture: (n,) where to (rad).
            time: Time since the start of the jump (s).
            duration: Of the motion (s).
        """
        ...


class MinimumJerkFlight:
    """Moves the joints to the landing posture and holds it."""

    yielding = 0.0

    def __init__(self, residual: ResidualFilter, dt: float, shift: Array | None) -> None:
        """Set up the phase.

        Args:
            residual: The filter of the residual.
            dt: Control period (s).
            shift: (n, 3) joint displacement (rad) per residual (m); ``None`` if the
                residual acts in the launching phase alone.
        """
        self._residual, self._dt, self._shift = residual, dt, shift
        self._motion: MinimumJerk
        self._began = 0.0
        self.command = JointCommand()

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        self._motion = MinimumJerk(
            state.joint_position.copy(), plan.landing_posture, plan.retraction_time
        )
        self._began = time
        self._residual.reset()

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        return self.go_on(time, residual_target)

    def go_on(self, time: float, residual_target: Array) -> Tick:
        """The motion goes on to its end, where it stays."""
        position, velocity = self._motion.sample(time - self._began)
        if self._shift is not None:
            self._residual.step(residual_target, self._dt)
            position = position + self._shift @ self._residual.offset[:3]
            velocity = velocity + self._shift @ self._residual.velocity[:3]
        self.command = JointCommand(velocity, position)
        return Tick(self.command, None)

    def move_to(self, posture: Array, time: float, duration: float) -> None:
        """The next motion begins where this one is; the residual remains on top."""
        now, _ = self._motion.sample(time - self._began)
        self._motion, self._began = MinimumJerk(now, posture, duration), time


class Aim(Record):
    """Where feedback wants the soles, and what it keeps between ticks.

    Attributes:
        dt: Control period (s).
        mass: kg.
        inverse_inertia: (3, 3) of the robot as one rigid body, base axes (1/(kg m^2)).
        rest: (3,) CoM from the middle of the soles in the landing posture (m).
        spread: (2, 3) soles from their middle in the landing posture (m).
        placement: (2,) soles ahead of the CoM, forward and left (m).
        reach: How far the legs reach for the ground, from 0 to 1.
        yielded, yielding: How far the legs gave way (m), and how fast they do (m/s).
        soles: (2, 3) wanted middles of the soles from the CoM, base axes (m).
        orientation: (3, 3) wanted orientation of both soles in the base.
    """

    dt: Number
    mass: Number
    inverse_inertia: Rotation
    rest: Vector
    spread: Annotated[Array, (2, 3)]
    placement: Annotated[Array, (2,)]
    reach: Number
    yielded: Number
    yielding: Number
    soles: Annotated[Array, (2, 3)]
    orientation: Rotation


class Motion(Record):
    """A motion of the joints that begins at rest, to a posture that may move.

    Attributes:
        fastest: (n,) largest speeds of corrections and commands (rad/s).
        lower, upper: (n,) position limits (rad).
        start: (n,) where it began (rad).
        posture: (n,) where it goes (rad).
        rate: (n,) speed of the posture (rad/s).
    """

    fastest: PerJoint
    lower: PerJoint
    upper: PerJoint
    start: PerJoint
    posture: PerJoint
    rate: PerJoint


class FeedbackFlight:
    """The same, to a landing posture whose legs follow what the robot does in the air.

    The soles stay level with the ground, are placed where the CoM will come to rest, reach for
    the ground by the predicted time to touch-down, and give way when it comes.

    Attributes:
        setpoint: Its CoM position is relative to the middle of the soles (m).
        command: The latest command.
    """

    def __init__(
        self, residual: ResidualFilter, dt: float, kinematics: FeetFixedKinematics
    ) -> None:
        """Set up the phase.

        Args:
            residual: The filter of the residual.
            dt: Control period (s).
            kinematics: The model.
        """
        robot = kinematics.robot
        self._residual, self._dt = residual, dt
        self._stance = FeetFixedKinematics(robot)
        self._legs = LegKinematics(robot)
        self._aim = Aim(dt=dt, mass=kinematics.mass)
        self._motion = Motion(
            {"n": robot.n_joints},
            fastest=SPEED_SHARE * robot.velocity_limit,
            lower=robot.lower_position,
            upper=robot.upper_position,
        )
        self.setpoint = Setpoint.at_rest(robot.landing)
        self.command = JointCommand()
        self._began = self._duration = 0.0

    @property
    def yielding(self) -> float:
        """Speed at which the legs give way (m/s)."""
        return self._aim.yielding

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        self._began, self._duration = time, plan.retraction_time
        motion, aim = self._motion, self._aim
        motion.start[:] = state.joint_position
        motion.rate[:] = 0.0
        motion.posture[:] = plan.landing_posture
        self._stance.update(plan.landing_posture)
        aim.inverse_inertia[:] = np.linalg.inv(self._stance.A_base[3:, 3:])
        soles = self._stance.sole_positions
        aim.rest[:] = self._stance.com - soles.mean(axis=0)
        aim.spread[:] = soles - soles.mean(axis=0)
        aim.placement[:] = aim.reach = aim.yielded = aim.yielding = 0.0
        self._residual.reset()

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        self._residual.step(residual_target, self._dt)
        aim, motion = self._aim, self._motion
        take_aim(state.block, self._residual.offset, self.setpoint.block, aim.block)
        legs = self._legs.step(motion.posture, aim.soles, aim.orientation)
        move_posture(legs, self._dt, motion.block)
        return self._command(time)

    def go_on(self, time: float, residual_target: Array) -> Tick:
        """The motion goes on to its end, where it stays."""
        self._motion.rate[:] = 0.0
        return self._command(time)

    def move_to(self, posture: Array, time: float, duration: float) -> None:
        """The next motion begins with the latest command."""
        if self.command.position is not None:
            self._motion.start[:] = self.command.position
        self._motion.posture[:] = posture
        self._began, self._duration = time, duration

    def _command(self, time: float) -> Tick:
        velocity, position = np.empty((2, len(self._motion.start)))
        move(time - self._began, self._duration, self._motion.block, velocity, position)
        self.command = JointCommand(velocity, position)
        return Tick(self.command, None)


@compiled
def take_aim(state: Block, residual: Array, setpoint: Block, aim: Block) -> None:
    """Where the soles shall be at touch-down.

    Args:
        state: The believed state.
        residual: (5,) the first three are added to the CoM's place over the soles (m).
        setpoint: What says so; this sets the position of its CoM.
        aim: Block of the :class:`Aim`.
    """
    s, a, com = state[0], aim[0], setpoint[0].com_position
    # As one rigid body: what the legs do to the base comes back as an echo.
    momentum, ahead = np.empty(3), np.empty(3)
    rotate_back(s.base_rotation, s.angular_momentum, momentum)
    rotate(a.inverse_inertia, momentum, ahead)
    for i in range(3):
        ahead[i] *= LEAD
    turned, rotation = np.empty((3, 3)), np.empty((3, 3))
    rotation_of(ahead, turned)
    multiply(s.base_rotation, turned, rotation)
    # The soles turn with the robot, about the vertical alone.
    cos, sin = heading(rotation)
    turn = np.zeros((3, 3))
    turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1], turn[2, 2] = cos, -sin, sin, cos, 1.0

    place(s, cos, sin, a)
    reach_for_ground(s, abs(cos * s.angular_momentum[1] - sin * s.angular_momentum[0]), a)
    for i in range(3):
        com[i] = a.rest[i] + residual[i]
    com[0] -= a.placement[0]
    com[1] -= a.placement[1]
    com[2] += EXTENSION * a.reach - a.yielded

    from_com, world = np.empty(3), np.empty(3)
    for foot in range(2):
        for i in range(3):
            from_com[i] = a.spread[foot, i] - com[i]
        rotate(turn, from_com, world)
        rotate_back(rotation, world, a.soles[foot])
    multiply(rotation.T, turn, a.orientation)


@compiled
def place(state: Block, cos: float, sin: float, aim: Block) -> None:
    """Move the soles to where the CoM will come to rest; the yaw by cosine and sine."""
    height = aim.rest[2]
    lever, time = MOMENTUM_SHARE / (aim.mass * height), math.sqrt(height / GRAVITY)
    vx = state.com_velocity[0] + lever * state.angular_momentum[1]
    vy = state.com_velocity[1] - lever * state.angular_momentum[0]
    share = min(1.0, aim.dt / PLACEMENT_TIME)
    for axis in range(2):
        speed = cos * vx + sin * vy if axis == 0 else cos * vy - sin * vx
        wanted = min(max(time * speed, -FARTHEST[axis]), FARTHEST[axis])
        aim.placement[axis] += share * (wanted - aim.placement[axis])


@compiled
def reach_for_ground(state: Block, turning: float, aim: Block) -> None:
    """Extend the legs by the predicted time to touch-down, then let them give way.

    Args:
        state: The believed state.
        turning: Size of the pitch momentum (kg m^2/s).
        aim: The aim.
    """
    speed = state.com_velocity[2]
    fall = max(0.0, state.com[2] - aim.rest[2] - EXTENSION)
    impact = math.sqrt(speed * speed + 2.0 * GRAVITY * fall)
    left = (speed + impact) / GRAVITY
    calm = turning < CALM_MOMENTUM and abs(aim.placement[0]) < CALM_PLACEMENT
    wait = OVERSHOOT_TIME if calm else 0.0
    if left < EXTENSION_TIME + wait + YIELD_TIME:
        aim.reach = min(1.0, aim.reach + aim.dt / EXTENSION_TIME)
    if left < YIELD_TIME and aim.placement[0] > -FARTHEST_BACK:
        fastest = YIELD_SHARE * impact
        faster = aim.yielding + aim.dt / YIELD_TIME * fastest
        aim.yielding = min(fastest, faster) if aim.yielded < FARTHEST_YIELD else 0.0
        aim.yielded += aim.dt * aim.yielding
    else:
        aim.yielding = 0.0


@compiled
def move_posture(legs: Array, dt: float, motion: Block) -> None:
    """Move the posture's legs, which come first, to (12,) positions (rad) as fast as they may."""
    m = motion[0]
    for j in range(legs.shape[0]):
        rate = (legs[j] - m.posture[j]) / dt
        m.rate[j] = min(max(rate, -m.fastest[j]), m.fastest[j])
        m.posture[j] += dt * m.rate[j]


@compiled
def move(since: float, duration: float, motion: Block, velocity: Array, position: Array) -> None:
    """Command the motion, minimum jerk with a goal that moves.

    Args:
        since: Time since it began (s).
        duration: Time to the posture (s).
        motion: Block of the :class:`Motion`.
        velocity: (n,) commanded velocities (rad/s), which this writes.
        position: (n,) commanded positions (rad), likewise.
    """
    m = motion[0]
    done, rate = progress(min(since / duration, 1.0))
    for j in range(velocity.shape[0]):
        way = m.posture[j] - m.start[j]
        speed = rate / duration * way + done * m.rate[j]
        velocity[j] = min(max(speed, -m.fastest[j]), m.fastest[j])
        reached = m.start[j] + done * way + LAG * velocity[j]
        position[j] = min(max(reached, m.lower[j]), m.upper[j])
