"""Flight: minimum jerk to the landing posture (paper section III-C), or feedback to the soles."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.phases import PhaseController, Tick
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.minimum_jerk import MinimumJerk, progress
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.soles import LegKinematics

Array = NDArray[np.float64]

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
        yielding: Speed at which the legs give way (m/s).
    """

    command: JointCommand
    yielding: float

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
            position = position + self._shift @ self._residual.offset
            velocity = velocity + self._shift @ self._residual.velocity
        self.command = JointCommand(velocity, position)
        return Tick(self.command, None)

    def move_to(self, posture: Array, time: float, duration: float) -> None:
        """The next motion begins where this one is; the residual remains on top."""
        now, _ = self._motion.sample(time - self._began)
        self._motion, self._began = MinimumJerk(now, posture, duration), time


class FeedbackFlight:
    """The same, to a landing posture whose legs follow what the robot does in the air.

    The soles stay level with the ground, are placed where the CoM will come to rest, reach for
    the ground by the predicted time to touch-down, and give way when it comes.

    Attributes:
        setpoint: Its CoM position is relative to the middle of the soles (m).
        command: The latest command.
        yielding: Speed at which the legs give way (m/s).
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
        self._residual, self._dt, self._mass = residual, dt, kinematics.mass
        self._robot = robot = kinematics.robot
        self._stance = FeetFixedKinematics(robot)
        self._legs = LegKinematics(robot)
        self._fastest = SPEED_SHARE * robot.velocity_limit
        self.setpoint = Setpoint.at_rest(robot.landing)
        self.command = JointCommand()
        n = robot.n_joints
        self._start, self._posture, self._rate = np.zeros(n), np.zeros(n), np.zeros(n)
        self._began = self._duration = 0.0
        self._inverse_inertia = np.eye(3)
        self._rest = np.zeros(3)
        self._spread = np.zeros((2, 3))
        self._placement = [0.0, 0.0]
        self._reach = self._yielded = self.yielding = 0.0

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        self._began, self._duration = time, plan.retraction_time
        self._start[:] = state.joint_position
        self._rate[:] = 0.0
        self._posture[:] = plan.landing_posture
        self._stance.update(plan.landing_posture)
        self._inverse_inertia = np.linalg.inv(self._stance.A_base[3:, 3:])
        soles = self._stance.sole_positions
        self._rest[:] = self._stance.com - soles.mean(axis=0)
        self._spread[:] = soles - soles.mean(axis=0)
        self._placement = [0.0, 0.0]
        self._reach = self._yielded = self.yielding = 0.0
        self._residual.reset()

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        self._residual.step(residual_target, self._dt)
        # As one rigid body: what the legs do to the base comes back as an echo.
        spin = self._inverse_inertia.dot(state.angular_momentum.dot(state.base_rotation))
        rotation = state.base_rotation.dot(pin.exp3(LEAD * spin))
        # The soles turn with the robot, about the vertical alone.
        cos, sin = heading(rotation)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        self._place(state, cos, sin)
        soles = (self._spread - self.setpoint.com_position).dot(turn.T)
        legs = self._legs.step(self._posture, soles.dot(rotation), rotation.T.dot(turn))
        joints = self._legs.joints
        rate, fastest = self._rate[joints], self._fastest[joints]
        np.subtract(legs, self._posture[joints], out=rate)
        rate /= self._dt
        np.minimum(np.maximum(rate, -fastest, out=rate), fastest, out=rate)
        self._posture += self._dt * self._rate
        return self._command(time)

    def go_on(self, time: float, residual_target: Array) -> Tick:
        """The motion goes on to its end, where it stays."""
        self._rate[:] = 0.0
        return self._command(time)

    def move_to(self, posture: Array, time: float, duration: float) -> None:
        """The next motion begins with the latest command."""
        if self.command.position is not None:
            self._start[:] = self.command.position
        self._posture[:] = posture
        self._began, self._duration = time, duration

    def _command(self, time: float) -> Tick:
        done, rate = progress(min((time - self._began) / self._duration, 1.0))
        way = self._posture - self._start
        velocity = rate / self._duration * way + done * self._rate
        fastest, robot = self._fastest, self._robot
        np.minimum(np.maximum(velocity, -fastest, out=velocity), fastest, out=velocity)
        position = self._start + done * way + LAG * velocity
        np.maximum(position, robot.lower_position, out=position)
        np.minimum(position, robot.upper_position, out=position)
        self.command = JointCommand(velocity, position)
        return Tick(self.command, None)

    def _place(self, state: RobotState, cos: float, sin: float) -> None:
        """Set where the CoM shall be relative to the soles at touch-down.

        Args:
            state: The believed state.
            cos: Cosine of the robot's yaw.
            sin: Its sine.
        """
        height = float(self._rest[2])
        Hx, Hy, _ = state.angular_momentum.tolist()
        vx, vy, _ = state.com_velocity.tolist()
        lever, time = MOMENTUM_SHARE / (self._mass * height), math.sqrt(height / GRAVITY)
        share = min(1.0, self._dt / PLACEMENT_TIME)
        vx, vy = vx + lever * Hy, vy - lever * Hx
        for axis, speed in enumerate((cos * vx + sin * vy, cos * vy - sin * vx)):
            wanted = min(max(time * speed, -FARTHEST[axis]), FARTHEST[axis])
            self._placement[axis] += share * (wanted - self._placement[axis])
        self._reach_for_ground(state, height, abs(cos * Hy - sin * Hx))
        com = self.setpoint.com_position
        np.add(self._rest, self._residual.offset, out=com)
        com[0] -= self._placement[0]
        com[1] -= self._placement[1]
        com[2] += EXTENSION * self._reach - self._yielded

    def _reach_for_ground(self, state: RobotState, height: float, turning: float) -> None:
        speed = float(state.com_velocity[2])
        fall = max(0.0, float(state.com[2]) - height - EXTENSION)
        impact = math.sqrt(speed * speed + 2.0 * GRAVITY * fall)
        left = (speed + impact) / GRAVITY
        calm = turning < CALM_MOMENTUM and abs(self._placement[0]) < CALM_PLACEMENT
        wait = OVERSHOOT_TIME if calm else 0.0
        if left < EXTENSION_TIME + wait + YIELD_TIME:
            self._reach = min(1.0, self._reach + self._dt / EXTENSION_TIME)
        if left < YIELD_TIME and self._placement[0] > -FARTHEST_BACK:
            fastest = YIELD_SHARE * impact
            faster = self.yielding + self._dt / YIELD_TIME * fastest
            self.yielding = min(fastest, faster) if self._yielded < FARTHEST_YIELD else 0.0
            self._yielded += self._dt * self.yielding
        else:
            self.yielding = 0.0
