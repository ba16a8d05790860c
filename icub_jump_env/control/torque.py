"""Torque controller: the QP of eq. 6, paper section III-E.

Unknowns are the joint accelerations and the contact wrenches of both feet, (s_ddot, f);
with the left foot at rest the base acceleration follows, and the torques are recovered
from the equations of motion. That is the paper's (tau, f) problem in other coordinates:
the CoM task and the momentum constraint become rows on f alone.

Dynamics, feet, limits, friction, unilateral force and CoP are hard. The CoM task (6b) and
the momentum constraint (6d) enter the cost with large weights; where they clash with a
limit, the robot gives way in the order of the weights: first posture and continuity,
then momentum and CoM; never a limit, a contact constraint or the feet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number, check_numbers
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.contact import ContactLimits, contact_rows
from icub_jump_env.control.qp import IDLE, QuadraticProgram
from icub_jump_env.control.solvers import CheckedSolver, SolverName
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.reference.com_reference import ComReference
from icub_jump_env.robot import facts
from icub_jump_env.robot.dynamics import GRAVITY, FeetFixedDynamics

Array = NDArray[np.float64]

_N = facts.N_JOINTS
_UNBOUNDED = 1e6


@dataclass(frozen=True)
class TorqueGains:
    """Gains and weights of eq. 6.

    Attributes:
        posture_stiffness, posture_damping: K_p (1/s^2) and K_d (1/s) of the posture task.
        com_stiffness, com_damping: K_p (1/s^2) and K_d (1/s) of the CoM task.
        momentum: K of the momentum constraint (1/s).
        posture_weight: Diagonal of Lambda, per joint ((rad/s^2)^-2).
        continuity_weight: Diagonal of Delta, per joint (Nm^-2).
        com_weight: Weight of the CoM task's residual ((m/s^2)^-2).
        momentum_weight: Weight of the momentum residual (Nm^-2).
        wrench_weight: Weight of the contact wrenches (N^-2, (Nm)^-2); makes their
            distribution over the feet unique.
        speed_horizon: Speed limits must hold after this long (s) at the acceleration
            that the QP decides.
        limit_horizon: Position limits likewise (s).

    Raises:
        ConfigError: If a value is out of range.
    """

    posture_stiffness: float = 10.0
    posture_damping: float = 6.0
    com_stiffness: float = 200.0
    com_damping: float = 28.0
    momentum: float = 10.0
    posture_weight: tuple[float, ...] = (1.0,) * 15 + (0.1,) * 8
    continuity_weight: tuple[float, ...] = (1e-3,) * _N
    com_weight: float = 1e4
    momentum_weight: float = 3e3
    wrench_weight: float = 1e-4
    speed_horizon: float = 0.005
    limit_horizon: float = 0.02

    def __post_init__(self) -> None:
        for field in ("posture_stiffness", "posture_damping", "com_stiffness", "com_damping"):
            check_number(field, getattr(self, field), 0.0, 1e5)
        check_number("momentum", self.momentum, 0.0, 1e3)
        check_numbers("posture_weight", self.posture_weight, _N, 1e-6, 1e6)
        check_numbers("continuity_weight", self.continuity_weight, _N, 0.0, 1e6)
        check_number("com_weight", self.com_weight, 0.0, 1e8)
        check_number("momentum_weight", self.momentum_weight, 0.0, 1e8)
        check_number("wrench_weight", self.wrench_weight, 1e-9, 1.0)
        check_number("speed_horizon", self.speed_horizon, 1e-3, 1.0)
        check_number("limit_horizon", self.limit_horizon, 1e-3, 1.0)


class TorqueController:
    """Joint torques that track the CoM reference with the feet at rest.

    Attributes:
        problem: The QP in (s_ddot, f), 35 variables; rows: 23 torques, 20 contact
            constraints, then the equalities: 6 of the base, 6 of the feet.
        report: How the latest tick's QP went.
        solution: (35,) latest applied solution.
    """

    def __init__(
        self,
        posture: Array,
        holding_torque: Array,
        position_limits: tuple[Array, Array],
        dynamics: FeetFixedDynamics,
        momentum_control: bool = True,
        solver: SolverName = "daqp",
        gains: TorqueGains | None = None,
        contact: ContactLimits | None = None,
    ) -> None:
        """Set up the QP.

        Args:
            posture: (23,) s_d of the posture task (rad).
            holding_torque: (23,) torques before the first tick (Nm).
            position_limits: Lower and upper joint limits, (23,) each (rad).
            dynamics: Equations of motion on fixed feet.
            momentum_control: Whether the momentum constraint (6d) is posed.
            solver: QP solver.
            gains: Gains; the defaults if ``None``.
            contact: Limits of the contact wrenches; the defaults if ``None``.
        """
        gains, contact = gains or TorqueGains(), contact or ContactLimits()
        cone = contact_rows(contact)
        problem = QuadraticProgram(_N + 12, n_inequalities=_N + 2 * len(cone), n_equalities=12)
        self.problem = problem
        self._solver = CheckedSolver(solver, problem)
        self._gains = gains
        self._dynamics = dynamics
        self._momentum_control = momentum_control
        self._posture = posture
        self._lower_position, self._upper_position = position_limits
        self._holding_torque = holding_torque
        self._previous = holding_torque.copy()
        self._Lambda = np.array(gains.posture_weight)
        self._sqrt_Delta = np.sqrt(np.array(gains.continuity_weight))[:, None]
        self._com_scale = math.sqrt(gains.com_weight) / dynamics.mass
        self._momentum_scale = math.sqrt(gains.momentum_weight)
        self._diagonal = np.concatenate((self._Lambda, np.full(12, gains.wrench_weight)))
        # Rows and residual at x = 0 of the least squares: continuity, CoM, momentum.
        self._rows = np.zeros((_N + (6 if momentum_control else 3), problem.n))
        self._residual = np.zeros(len(self._rows))
        self._set_constant_rows(cone, contact.minimum_force)
        self.solution = np.zeros(problem.n)
        self.report = IDLE

    def _set_constant_rows(self, cone: Array, minimum_force: float) -> None:
        problem, n = self.problem, self.problem.n
        for foot in range(2):
            rows = slice(_N + len(cone) * foot, _N + len(cone) * (foot + 1))
            problem.C[rows, _N + 6 * foot : _N + 6 * foot + 6] = cone
        rows = slice(n + _N, n + _N + 2 * len(cone))
        problem.lower[rows] = -_UNBOUNDED
        problem.lower[_N:n], problem.upper[_N:n] = -_UNBOUNDED, _UNBOUNDED
        problem.lower[[_N + 2, _N + 8]] = minimum_force

    def reset(self) -> None:
        """Forget the previous torques."""
        self._previous[:] = self._holding_torque
        self.solution[:] = 0.0
        self.report = IDLE

    def command(
        self,
        estimator: FeetFixedEstimator,
        joint_position: Array,
        joint_velocity: Array,
        reference: ComReference,
    ) -> JointCommand:
        """One control tick, as :class:`icub_jump_env.control.jump.LaunchController`.

        The command carries (23,) joint torques (Nm) within the limits.
        """
        dynamics = self._dynamics
        dynamics.update(joint_position, joint_velocity)
        self._pose_cost(estimator, joint_position, joint_velocity, reference)
        self._pose_constraints(estimator, joint_position, joint_velocity)
        solution, self.report = self._solver.solve()
        torque = self._previous
        if not self.report.failed:
            self.solution[:] = solution.x
            np.add(dynamics.torque_rows.dot(solution.x), dynamics.torque_bias, out=torque)
            np.minimum(torque, facts.EFFORT_LIMIT, out=torque)
            np.maximum(torque, -facts.EFFORT_LIMIT, out=torque)
        return JointCommand(torque=torque.copy())

    def _pose_cost(
        self, estimator: FeetFixedEstimator, s: Array, s_dot: Array, reference: ComReference
    ) -> None:
        gains, problem, dynamics = self._gains, self.problem, self._dynamics
        kinematics = estimator.kinematics
        world_R_base = kinematics.base_rotation
        rows, residual = self._rows, self._residual
        # Continuity (6a): tau - tau_{k-1}, with tau = T x + t.
        np.multiply(self._sqrt_Delta, dynamics.torque_rows, out=rows[:_N])
        np.subtract(dynamics.torque_bias, self._previous, out=residual[:_N])
        residual[:_N] *= self._sqrt_Delta[:, 0]
        # CoM (6b): the contact forces and gravity give the wanted acceleration.
        wanted = reference.acceleration - GRAVITY
        wanted -= gains.com_stiffness * (estimator.com - reference.position)
        wanted -= gains.com_damping * (estimator.com_velocity - reference.velocity)
        np.multiply(dynamics.force_rows, self._com_scale, out=rows[_N : _N + 3, _N:])
        np.dot(wanted, world_R_base, out=residual[_N : _N + 3])
        residual[_N : _N + 3] *= -self._com_scale * kinematics.mass
        if self._momentum_control:
            # Momentum (6d): the contact moments about the CoM are -K H_omega.
            scale = self._momentum_scale
            np.multiply(dynamics.moment_rows, scale, out=rows[_N + 3 :, _N:])
            np.dot(estimator.angular_momentum, world_R_base, out=residual[_N + 3 :])
            residual[_N + 3 :] *= scale * gains.momentum

        np.matmul(rows.T, rows, out=problem.H)
        problem.H.reshape(-1)[:: problem.n + 1] += self._diagonal
        np.dot(residual, rows, out=problem.g)
        posture = gains.posture_stiffness * (self._posture - s)
        posture -= gains.posture_damping * s_dot
        posture *= self._Lambda
        problem.g[:_N] -= posture

    def _pose_constraints(self, estimator: FeetFixedEstimator, s: Array, s_dot: Array) -> None:
        gains, problem, dynamics = self._gains, self.problem, self._dynamics
        n, lower, upper = problem.n, problem.lower, problem.upper
        problem.C[:_N] = dynamics.torque_rows
        np.subtract(-facts.EFFORT_LIMIT, dynamics.torque_bias, out=lower[n : n + _N])
        np.subtract(facts.EFFORT_LIMIT, dynamics.torque_bias, out=upper[n : n + _N])
        problem.C[-12:-6] = dynamics.base_rows
        problem.C[-6:, :_N] = estimator.kinematics.J_feet  # (6c)
        for bound in (lower, upper):
            bound[-12:-6] = dynamics.base_bias
            bound[-6:] = dynamics.foot_bias

        # (6e): after the horizon the speed, and s + T s_dot + T^2/2 s_ddot, are within
        # their limits; where both cannot be, the speed is.
        horizon = gains.limit_horizon
        drift = s + horizon * s_dot
        slowest = (-facts.VELOCITY_LIMIT - s_dot) / gains.speed_horizon
        fastest = (facts.VELOCITY_LIMIT - s_dot) / gains.speed_horizon
        for limit, bound in (
            (self._lower_position, lower[:_N]),
            (self._upper_position, upper[:_N]),
        ):
            np.multiply(limit - drift, 2.0 / horizon**2, out=bound)
            np.maximum(bound, slowest, out=bound)
            np.minimum(bound, fastest, out=bound)
