"""The landing by a whole-body QP with contact wrenches that :mod:`experiments.wrench_landing` tries."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pinocchio as pin

from icub_jump_env.compiled import compiled
from icub_jump_env.control.catching import LOWEST_COM
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import ContactConfig, SolverName, Weights
from icub_jump_env.control.flight import Flight
from icub_jump_env.control.landing import FeedbackLanding
from icub_jump_env.control.phases import Tick
from icub_jump_env.control.qp.problem import QuadraticProgram
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.control.tasks.com import com_acceleration
from icub_jump_env.control.tasks.contact import limit_wrenches
from icub_jump_env.control.tasks.feet import feet_acceleration
from icub_jump_env.control.tasks.least_squares import least_squares
from icub_jump_env.control.tasks.limits import acceleration_limits, torque_limits
from icub_jump_env.control.tasks.momentum import momentum_rate
from icub_jump_env.control.tasks.motion import base_motion
from icub_jump_env.control.tasks.posture import posture_acceleration
from icub_jump_env.control.tasks.smoothness import torque_smoothness
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.records import Array, Block, Number, PerJoint, Record
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics


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


class WrenchTerms(Record):
    """What the QP has beside model, state and set point.

    Attributes:
        com_weight, momentum_weight, feet_weight: Weights of these tasks.
        momentum, feet_damping: As in :class:`WrenchGains` (1/s).
        posture_stiffness, posture_damping: Likewise (1/s^2, 1/s).
        posture_weight, smoothness_weight: (n,) likewise.
        diagonal: (n + 12,) weights of posture and wrenches.
        speed_horizon, limit_horizon: s.
        lift: Speed at which the right sole shall rise relative to the left one (m/s).
        previous: (n,) previous torques (Nm).
    """

    com_weight: Number
    momentum_weight: Number
    feet_weight: Number
    momentum: Number
    feet_damping: Number
    posture_stiffness: Number
    posture_damping: Number
    posture_weight: PerJoint
    smoothness_weight: PerJoint
    diagonal: Annotated[Array, ("n + 12",)]
    speed_horizon: Number
    limit_horizon: Number
    lift: Number
    previous: PerJoint


@compiled
def soles_damped(
    model: Block,
    dynamics: Block,
    state: Block,
    lift: float,
    damping: float,
    scale: float,
    rows: Array,
    target: Array,
) -> None:
    """The soles lose their motion relative to each other, but for a vertical speed.

    Args:
        model: Kinematics of both feet at rest.
        dynamics: Equations of motion.
        state: The believed state.
        lift: Speed at which the right sole shall rise relative to the left one (m/s).
        damping: How fast another motion is taken off (1/s).
        scale: Root of the weight.
        rows: (6, n + 12) A: left foot minus right foot, base axes.
        target: (6,) b.
    """
    feet_acceleration(model, dynamics, rows, target)
    for i in range(6):
        motion = lift * model.base_rotation[2, i] if i < 3 else 0.0
        for j in range(model.J_feet.shape[1]):
            motion += model.J_feet[i, j] * state.joint_velocity[j]
        target[i] = scale * (target[i] - damping * motion)
        for j in range(rows.shape[1]):
            rows[i, j] *= scale


@compiled
def pose(
    kinematics: Block,
    dynamics: Block,
    limits: Block,
    state: Block,
    setpoint: Block,
    terms: Block,
    constrained: bool,
    rows: Array,
    target: Array,
    problem: Block,
) -> None:
    """Write the QP in joint accelerations and contact wrenches, as that of eq. 6."""
    model, motion, believed, wanted = kinematics[0], dynamics[0], state[0], setpoint[0]
    t, p = terms[0], problem[0]
    n = t.previous.shape[0]
    n_x, equalities = n + 12, n + 20
    lower, upper = p.lower[n_x:], p.upper[n_x:]
    p.g[:] = 0.0
    posture_acceleration(
        believed, wanted, t.posture_stiffness, t.posture_damping, t.posture_weight, p.g
    )
    torque_smoothness(motion, t.previous, t.smoothness_weight, rows[:n], target[:n])
    scale = math.sqrt(t.com_weight)
    com, momentum, feet = slice(n, n + 3), slice(n + 3, n + 6), slice(n + 6, n + 12)
    com_acceleration(motion, believed, wanted, 0.0, 0.0, scale, rows[com], target[com])
    scale = math.sqrt(t.momentum_weight)
    momentum_rate(motion, believed, wanted, t.momentum, scale, rows[momentum], target[momentum])
    base_motion(motion, p.C[equalities : equalities + 6], lower[equalities : equalities + 6])
    if constrained:
        soles_damped(
            model, motion, believed, t.lift, t.feet_damping, 1.0,
            p.C[equalities + 6 :], lower[equalities + 6 :],
        )  # fmt: skip
    else:
        scale = math.sqrt(t.feet_weight)
        soles_damped(
            model, motion, believed, t.lift, t.feet_damping, scale, rows[feet], target[feet]
        )
    least_squares(rows, target, t.diagonal, p.H, p.g)
    acceleration_limits(
        limits[0], believed, t.speed_horizon, t.limit_horizon, p.lower[:n], p.upper[:n]
    )
    torque_limits(limits[0], motion, p.C[:n], lower[:n], upper[:n])
    upper[equalities:] = lower[equalities:]


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
        self.dynamics = FeetFixedDynamics(kinematics)
        self.solution = np.zeros(n + 12)
        self._rate, self._rise, self._lifting = np.zeros(n), 0.0, 0.0
        inner = dataclasses.replace(
            sole,
            x_min=sole.x_min + margin,
            x_max=sole.x_max - margin,
            half_width=sole.half_width - margin,
        )
        constrained = math.isinf(gains.feet_weight)
        posture_weight = robot.per_joint("posture", gains.posture_weight)
        stiffness, damping = gains.posture
        speed_horizon, limit_horizon = gains.horizons
        self._wrench_terms = WrenchTerms(
            {"n": n, "n + 12": n + 12},
            com_weight=gains.com_weight,
            momentum_weight=gains.momentum_weight,
            feet_weight=0.0 if constrained else gains.feet_weight,
            momentum=gains.momentum,
            feet_damping=gains.feet_damping,
            posture_stiffness=stiffness,
            posture_damping=damping,
            posture_weight=posture_weight,
            smoothness_weight=gains.smoothness_weight,
            diagonal=np.concatenate((posture_weight, np.full(12, gains.wrench_weight))),
            speed_horizon=speed_horizon,
            limit_horizon=limit_horizon,
        )
        self.problem = problem = QuadraticProgram(n + 12, n + 20, 12 if constrained else 6)
        of_rows = slice(n + 12 + n, n + 12 + n + 20)
        limit_wrenches(
            ContactConfig(friction=gains.friction, minimum_force=gains.least_force),
            inner,
            problem.C[n : n + 20, n:],
            problem.lower[of_rows],
            problem.upper[of_rows],
            problem.lower[n : n + 12],
        )
        n_costs = n + 6 if constrained else n + 12
        self._rows, self._target = np.zeros((n_costs, n + 12)), np.zeros(n_costs)
        self._constrained = constrained
        self._wrench_solver = CheckedSolver(solver, problem)

    @property
    def torque(self) -> Array:
        """(n,) what the QP decided (Nm)."""
        return self._wrench_terms.previous

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
            self._rate[:] = self._terms.previous
            return tick
        gains, setpoint, dt = self._gains, self.setpoint, self._dt
        s_dot, limit, wanted = state.joint_velocity, self._robot.effort_limit, self.torque
        self._residual.step(residual_target, dt)
        # From here on the vertical is that of gravity, and the IMU says how the base stands.
        upright = pin.exp3(np.cross(state.gravity, [0.0, 0.0, -1.0]))
        np.dot(upright, state.base_rotation, out=self._kinematics.base_rotation)
        self.dynamics.update(state.joint_position, s_dot)
        self._demand(state, time)
        pose(
            self._kinematics.block, self.dynamics.block, self._limits.block, state.block,
            setpoint.block, self._wrench_terms.block, self._constrained, self._rows, self._target,
            self.problem.block,
        )  # fmt: skip
        solution, report = self._wrench_solver.solve()
        if report.failed:
            wanted *= 0.9
            acceleration = np.zeros_like(s_dot)
        else:
            self.solution[:] = solution.x
            np.dot(self.dynamics.torque_rows, solution.x, out=wanted)
            wanted += self.dynamics.torque_bias
            acceleration = solution.x[:-12]
        self._rate += dt * (acceleration + gains.leak * (s_dot - self._rate))
        torque = wanted + gains.joint_damping * (self._rate - s_dot)
        return Tick(JointCommand(torque=np.clip(torque, -limit, limit)), report)

    def _stand_at(self, time: float) -> tuple[float, float, float]:
        """As :class:`FeedbackLanding`; also the rise's derivative (m/s^2)."""
        forward, height, rise = super()._stand_at(time)
        self._lifting, self._rise = (rise - self._rise) / self._dt, rise
        return forward, height, rise

    def _demand(self, state: RobotState, time: float) -> None:
        """Set the accelerations of CoM and lunge in the set point, and what the soles do."""
        gains, setpoint = self._gains, self.setpoint
        offset, velocity = self._residual.offset[:3], self._residual.velocity[:3]
        forward, height, rise = self._stand_at(time)
        height, rise = height + offset[2], rise + velocity[2]
        # The ankles are where balance has them.
        setpoint.posture[self._ankles] = state.joint_position[self._ankles]
        setpoint.com_position[:] = forward + offset[0], offset[1], height
        away = state.joint_position - setpoint.posture
        catching = self._balance(state, setpoint.com_position, away)
        self._wrench_terms.lift = catching.lift
        momentum, most = setpoint.angular_momentum, gains.hardest_lunge
        lunge = min(max((catching.momentum - momentum[1]) / self._dt, -most), most)
        momentum[1] += lunge * self._dt
        setpoint.angular_momentum_rate[1] = lunge

        stiffness, damping = gains.height
        setpoint.com_acceleration[:] = self._horizontal(state, catching.pull, lunge)
        setpoint.com_acceleration[2] = (
            self._lifting
            + stiffness * (height - self._kinematics.com[2])
            + damping * (rise - state.com_velocity[2])
        )
        # From the vertical of the floor's frame to that of gravity.
        setpoint.com_acceleration -= GRAVITY * state.gravity
        setpoint.com_acceleration[2] -= GRAVITY

    def _horizontal(self, state: RobotState, pull: Array, lunge: float) -> Array:
        """The CoM's acceleration (3,) of the pendulum, with the lunge's moment (Nm) (m/s^2)."""
        cos, sin = heading(state.base_rotation)
        height = max(LOWEST_COM, float((state.com - state.sole_position.mean(axis=0))[2]))
        ahead, left = GRAVITY * pull
        ahead -= lunge / (self._kinematics.mass * height)
        return np.array([cos * ahead - sin * left, sin * ahead + cos * left, 0.0])
