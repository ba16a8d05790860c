"""The landing by a whole-body QP with contact wrenches that :mod:`experiments.wrench_landing` tries."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.control.catching import (
    FARTHEST_LATERAL_COP,
    LATERAL_CAPTURE_GAIN,
    LOWEST_COM,
    MOMENTUM_SHARE,
    Balance,
)
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import ContactConfig, SolverName, Weights
from icub_jump_env.control.flight import Flight
from icub_jump_env.control.landing import FeedbackLanding
from icub_jump_env.control.phases import Tick
from icub_jump_env.control.tasks.com import ComAcceleration
from icub_jump_env.control.tasks.contact import ContactLimits, SmallWrenches
from icub_jump_env.control.tasks.feet import FeetAcceleration
from icub_jump_env.control.tasks.limits import AccelerationLimits, TorqueLimits
from icub_jump_env.control.tasks.momentum import MomentumRate
from icub_jump_env.control.tasks.motion import BaseMotion
from icub_jump_env.control.tasks.posture import PostureAcceleration
from icub_jump_env.control.tasks.smoothness import TorqueSmoothness
from icub_jump_env.control.tasks.stack import TaskQP
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.robot.dynamics import GRAVITY, FeetFixedDynamics
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WrenchGains:
    """What the QP is made of.

    Attributes:
        impact: How long after touch-down the velocity QP goes on to yield (s).
        height: Stiffness and damping of the CoM's height (1/s^2, 1/s).
        com_weight: Weight of the CoM's acceleration ((m/s^2)^-2).
        momentum: How fast wrong angular momentum is taken off (1/s).
        momentum_weight: Weight of its rate (Nm^-2).
        hardest_lunge: Largest rate of the lunge's momentum (Nm).
        posture: Stiffness and damping of the posture (1/s^2, 1/s).
        posture_weight: Of legs, torso and arms ((rad/s^2)^-2).
        feet_damping: How fast a motion of the soles relative to each other is taken off (1/s).
        feet_weight: Weight of that ((m/s^2)^-2, (rad/s^2)^-2); infinite makes it a constraint.
        wrench_weight: Weight of the wrenches (N^-2, Nm^-2): the feet share the load.
        smoothness_weight: Weight of changes of the torques (Nm^-2).
        friction: Coulomb friction counted on.
        least_force: Of each foot (N).
        cop_margin: Distance of the CoP from the edges of the soles (m).
        horizons: When speed and position limits must hold (s).
        joint_damping: Torque per speed that the QP did not ask for (Nm s/rad).
        leak: How fast that speed, the integral of the accelerations, follows the joints (1/s).
    """

    impact: float = 0.1
    height: tuple[float, float] = (60.0, 14.0)
    com_weight: float = 1e3
    momentum: float = 8.0
    momentum_weight: float = 10.0
    hardest_lunge: float = 30.0
    posture: tuple[float, float] = (5.0, 4.5)
    posture_weight: Weights = (1.0, 1.0, 0.3)
    feet_damping: float = 30.0
    feet_weight: float = 1e3
    wrench_weight: float = 1e-3
    smoothness_weight: float = 1e-3
    friction: float = 0.4
    least_force: float = 5.0
    cop_margin: float = 0.003
    horizons: tuple[float, float] = (0.02, 0.06)
    joint_damping: float = 2.0
    leak: float = 20.0


class SolesDamped(FeetAcceleration):
    """The soles lose their motion relative to each other, but for a vertical speed.

    Attributes:
        speed: Speed at which the right sole shall rise relative to the left one (m/s).
    """

    speed = 0.0

    def __init__(
        self,
        kinematics: FeetFixedKinematics,
        dynamics: FeetFixedDynamics,
        damping: float,
        weight: float,
    ) -> None:
        super().__init__(kinematics, dynamics)
        self._damping, self.weight, self.scale = damping, weight, 1.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation; its rows have the left foot minus the right one, base axes."""
        super().write(state, setpoint, rows, target)
        motion = self._kinematics.J_feet @ state.joint_velocity
        motion[:3] += self.speed * self._kinematics.base_rotation[2]
        target -= self._damping * motion
        rows *= self.scale
        target *= self.scale


class WrenchLanding(FeedbackLanding):
    """Torques of all joints by one QP in joint accelerations and contact wrenches.

    Where the QP has no solution, the torques before it fade.

    Attributes:
        solution: (n + 12,) joint accelerations (rad/s^2) and the wrenches of the left and the
            right foot, force (N) and moment (Nm) in the sole frames.
        torque: (n,) the torques that belong to it (Nm).
        dynamics: The equations of motion that the latest QP had.
    """

    def __init__(
        self,
        flight: Flight,
        residual: ResidualFilter,
        dt: float,
        kinematics: FeetFixedKinematics,
        solver: SolverName,
        gains: WrenchGains,
    ) -> None:
        """Set up the phase, as :class:`FeedbackLanding`, with the gains of the QP."""
        super().__init__(flight, residual, dt, kinematics, solver)
        self._gains, robot = gains, kinematics.robot
        n, sole, margin = robot.n_joints, robot.sole, gains.cop_margin
        self.dynamics = dynamics = FeetFixedDynamics(kinematics)
        self.torque, self.solution = np.zeros(n), np.zeros(n + 12)
        self._rate, self._rise, self._lifting = np.zeros(n), 0.0, 0.0
        inner = dataclasses.replace(
            sole,
            x_min=sole.x_min + margin,
            x_max=sole.x_max - margin,
            half_width=sole.half_width - margin,
        )
        constrained = math.isinf(gains.feet_weight)
        self._soles = SolesDamped(
            kinematics, dynamics, gains.feet_damping, 1.0 if constrained else gains.feet_weight
        )
        feet = [self._soles]
        smooth = np.full(n, gains.smoothness_weight)
        self._wrench_qp = TaskQP(
            n + 12,
            costs=[
                PostureAcceleration(
                    *gains.posture, robot.per_joint("posture", gains.posture_weight)
                ),
                SmallWrenches(gains.wrench_weight, n),
            ],
            soft=[
                TorqueSmoothness(dynamics, smooth, self.torque),
                ComAcceleration(dynamics, 0.0, 0.0, gains.com_weight),
                MomentumRate(dynamics, gains.momentum, gains.momentum_weight),
                *([] if constrained else feet),
            ],
            hard=[BaseMotion(dynamics), *(feet if constrained else [])],
            limits=[
                AccelerationLimits(robot, *gains.horizons),
                TorqueLimits(dynamics, robot),
                ContactLimits(
                    ContactConfig(friction=gains.friction, minimum_force=gains.least_force),
                    dataclasses.replace(robot, sole=inner),
                ),
            ],
            solver=solver,
        )

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        super().start(state, plan, time)
        self.torque[:] = 0.0
        self._rate[:] = state.joint_velocity
        self._rise = -self._sinking
        self.setpoint.angular_momentum[:] = 0.0

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        if time - self._began < self._gains.impact:
            tick = super().tick(state, time, residual_target)
            self._rate[:] = self._velocity
            return tick
        gains, setpoint, dt = self._gains, self.setpoint, self._dt
        s_dot, limit = state.joint_velocity, self._robot.effort_limit
        self._residual.step(residual_target, dt)
        # From here on the vertical is that of gravity, and the IMU says how the base stands.
        upright = pin.exp3(np.cross(state.gravity, [0.0, 0.0, -1.0]))
        np.dot(upright, state.base_rotation, out=self._kinematics.base_rotation)
        self.dynamics.update(state.joint_position, s_dot)
        self._demand(state, time)
        solution, report = self._wrench_qp.solve(state, setpoint)
        if report.failed:
            self.torque *= 0.9
            acceleration = np.zeros_like(s_dot)
        else:
            self.solution[:] = solution.x
            np.dot(self.dynamics.torque_rows, solution.x, out=self.torque)
            self.torque += self.dynamics.torque_bias
            acceleration = solution.x[:-12]
        self._rate += dt * (acceleration + gains.leak * (s_dot - self._rate))
        torque = self.torque + gains.joint_damping * (self._rate - s_dot)
        return Tick(JointCommand(torque=np.clip(torque, -limit, limit)), report)

    def _stand_at(self, time: float) -> tuple[float, float, float]:
        """As :class:`FeedbackLanding`; also the rise's derivative (m/s^2)."""
        forward, height, rise = super()._stand_at(time)
        self._lifting, self._rise = (rise - self._rise) / self._dt, rise
        return forward, height, rise

    def _demand(self, state: RobotState, time: float) -> None:
        """Set the accelerations of CoM and lunge in the set point, and what the soles do."""
        gains, setpoint = self._gains, self.setpoint
        offset, velocity = self._residual.offset, self._residual.velocity
        forward, height, rise = self._stand_at(time)
        height, rise = height + offset[2], rise + velocity[2]
        # The ankles are where balance has them.
        setpoint.posture[self._ankles] = state.joint_position[self._ankles]
        setpoint.com_position[:] = forward + offset[0], offset[1], height
        away = state.joint_position - setpoint.posture
        balance = self._catch.update(state, setpoint.com_position, away)
        self._soles.speed = balance.lift
        momentum, most = setpoint.angular_momentum, gains.hardest_lunge
        lunge = min(max((balance.pitch_momentum - momentum[1]) / self._dt, -most), most)
        momentum[1] += lunge * self._dt
        setpoint.angular_momentum_rate[1] = lunge

        stiffness, damping = gains.height
        setpoint.com_acceleration[:] = self._horizontal(state, balance, lunge)
        setpoint.com_acceleration[2] = (
            self._lifting
            + stiffness * (height - self._kinematics.com[2])
            + damping * (rise - state.com_velocity[2])
        )
        setpoint.com_acceleration += GRAVITY - np.linalg.norm(GRAVITY) * state.gravity

    def _horizontal(self, state: RobotState, balance: Balance, lunge: float) -> Array:
        """The CoM's acceleration (3,) of the pendulum, with the lunge's moment (Nm) (m/s^2)."""
        cos, sin = heading(state.base_rotation)
        to_heading = np.array([[cos, sin], [-sin, cos]])
        com, down = state.com - state.sole_position.mean(axis=0), state.gravity
        height = max(LOWEST_COM, float(com[2]))
        frequency = math.sqrt(np.linalg.norm(GRAVITY) / height)
        lever = 1.0 / (self._kinematics.mass * height)
        ahead, left = to_heading @ (com[:2] - com[2] / down[2] * down[:2])
        goal = float((to_heading @ self.setpoint.com_position[:2])[1])
        # Sideways as forward in Catch, which tells only how the feet shall share the load.
        falling = -MOMENTUM_SHARE * lever * float(to_heading[0] @ state.angular_momentum[:2])
        speed = float(to_heading[1] @ state.com_velocity[:2]) + falling
        point = left - goal + speed / frequency
        wanted = point * (1.0 + LATERAL_CAPTURE_GAIN / frequency)
        cop = np.array(
            [
                balance.cop - self._robot.sole.center_x,
                goal + min(max(wanted, -FARTHEST_LATERAL_COP), FARTHEST_LATERAL_COP),
            ]
        )
        acceleration = frequency**2 * (np.array([ahead, left]) - cop)
        acceleration[0] -= lever * lunge
        return np.array([*(to_heading.T @ acceleration), 0.0])
