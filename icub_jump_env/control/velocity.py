"""Velocity controller: the QP of eq. 3, paper section III-D.

With the feet at rest (eq. 3c) the base velocity follows from the joints, so the QP is
posed in the joint velocities. Limits and feet are hard; the CoM task (3b) and the
momentum constraint (3d) enter the cost with large weights. As long as no limit is in
the way that is eq. 3 to within the ratio of the weights. Where tasks and limits clash,
the robot gives way in the order of the weights: first posture and smoothness, then
momentum, then the CoM; never a limit, never the feet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number, check_numbers
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.qp import IDLE, QuadraticProgram
from icub_jump_env.control.solvers import CheckedSolver, SolverName
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.reference.com_reference import ComReference
from icub_jump_env.robot import facts

Array = NDArray[np.float64]


def _per_joint(leg: float, torso: float, arm: float) -> tuple[float, ...]:
    return (leg,) * 12 + (torso,) * 3 + (arm,) * 8


@dataclass(frozen=True)
class VelocityGains:
    """Gains and weights of eq. 3.

    Attributes:
        posture: K_p of the posture task (1/s).
        com: K of the CoM task (1/s).
        momentum: K of the momentum constraint (1/s).
        posture_weight: Diagonal of Lambda, per joint.
        smoothness_weight: Diagonal of Delta, per joint.
        com_weight: Weight of the CoM task's residual ((m/s)^-2).
        momentum_weight: Weight of the momentum residual ((kg m^2/s)^-2).
        limit_horizon: Position limits must hold if the velocity is kept for this long (s).
            The paper takes one control period, in which no joint can stop.
        velocity_margin: Share of the speed limits that the QP may use; the rest is for
            the servos' overshoot.

    Raises:
        ConfigError: If a value is out of range.
    """

    posture: float = 1.0
    com: float = 10.0
    momentum: float = 10.0
    posture_weight: tuple[float, ...] = _per_joint(leg=1.0, torso=1.0, arm=0.1)
    smoothness_weight: tuple[float, ...] = _per_joint(leg=0.1, torso=0.1, arm=0.01)
    com_weight: float = 1e5
    momentum_weight: float = 1e3
    limit_horizon: float = 0.02
    velocity_margin: float = 0.98

    def __post_init__(self) -> None:
        n = facts.N_JOINTS
        for field in ("posture", "com", "momentum"):
            check_number(field, getattr(self, field), 0.0, 1e3)
        # One of the two must be positive, or the QP has no unique solution.
        check_numbers("posture_weight", self.posture_weight, n, 1e-6, 1e6)
        check_numbers("smoothness_weight", self.smoothness_weight, n, 0.0, 1e6)
        check_number("com_weight", self.com_weight, 0.0, 1e8)
        check_number("momentum_weight", self.momentum_weight, 0.0, 1e8)
        check_number("limit_horizon", self.limit_horizon, 0.0, 1.0)
        check_number("velocity_margin", self.velocity_margin, 0.01, 1.0)


class VelocityController:
    """Joint velocities that track the CoM reference with the feet at rest.

    Attributes:
        report: How the latest tick's QP went.
    """

    def __init__(
        self,
        posture: Array,
        position_limits: tuple[Array, Array],
        dt: float,
        momentum_control: bool = True,
        solver: SolverName = "daqp",
        gains: VelocityGains | None = None,
    ) -> None:
        """Set up the QP.

        Args:
            posture: (23,) s_d of the posture task (rad).
            position_limits: Lower and upper joint limits, (23,) each (rad).
            dt: Control period T_s (s).
            momentum_control: Whether the momentum constraint (3d) is posed.
            solver: QP solver.
            gains: Gains; the defaults if ``None``.
        """
        gains = gains or VelocityGains()
        n = facts.N_JOINTS
        problem = QuadraticProgram(n, n_inequalities=0, n_equalities=6)
        self.problem = problem
        self._solver = CheckedSolver(solver, problem)
        self._gains = gains
        self._dt = dt
        self._momentum_control = momentum_control
        # What does not change from tick to tick is multiplied out here.
        Lambda = np.array(gains.posture_weight)
        self._Delta = np.array(gains.smoothness_weight)
        self._diagonal = Lambda + self._Delta
        self._posture_weight = Lambda * gains.posture
        self._posture_pull = self._posture_weight * posture
        self._speed = facts.VELOCITY_LIMIT * gains.velocity_margin
        self._slowest = -self._speed
        self._horizon = max(gains.limit_horizon, dt)
        self._lower_rate, self._upper_rate = (limit / self._horizon for limit in position_limits)
        # Rows of the CoM task (3b), then of the momentum constraint (3d).
        self._rows = 6 if momentum_control else 3
        weights = np.repeat((gains.com_weight, gains.momentum_weight), 3)
        self._row_scale = np.sqrt(weights[: self._rows])
        self._task_scale = np.repeat(self._row_scale[:, None], n, axis=1)
        self._tasks = np.zeros((self._rows, n))
        self._targets = np.zeros(self._rows)
        self._previous = np.zeros(n)
        self._momentum_integral = np.zeros(3)
        self.report = IDLE

    def reset(self) -> None:
        """Forget the previous command and the momentum integral."""
        self._previous[:] = 0.0
        self._momentum_integral[:] = 0.0
        self.report = IDLE

    def command(
        self,
        estimator: FeetFixedEstimator,
        joint_position: Array,
        joint_velocity: Array,
        reference: ComReference,
    ) -> JointCommand:
        """One control tick, as :class:`icub_jump_env.control.jump.LaunchController`.

        The command carries (23,) joint velocities (rad/s) within the limits.
        """
        self._pose(estimator, joint_position, reference)
        solution, self.report = self._solver.solve()
        # Keeping on is the best guess when the solver has none. The limits take the
        # last rounding error off a solution; fmin and fmax pass over NaN limits.
        n, command = self.problem.n, self._previous
        if not self.report.failed:
            command[:] = solution.x
        np.fmin(command, self.problem.upper[:n], out=command)
        np.fmax(command, self.problem.lower[:n], out=command)
        return JointCommand(command.copy())

    def _pose(self, estimator: FeetFixedEstimator, s: Array, reference: ComReference) -> None:
        gains, problem, kinematics = self._gains, self.problem, estimator.kinematics
        tasks, targets = self._tasks, self._targets
        np.multiply(kinematics.centroidal_map[: self._rows], self._task_scale, out=tasks)
        error = estimator.com - reference.position
        targets[:3] = reference.velocity - gains.com * error  # (3b)
        if self._momentum_control:
            self._momentum_integral += estimator.angular_momentum * self._dt
            targets[3:] = -gains.momentum * self._momentum_integral  # (3d)
        targets *= self._row_scale

        np.matmul(tasks.T, tasks, out=problem.H)
        problem.H.reshape(-1)[:: problem.n + 1] += self._diagonal
        g = np.multiply(self._posture_weight, s, out=problem.g)
        g -= self._posture_pull
        g -= self._Delta * self._previous
        g -= targets.dot(tasks)

        problem.C[:] = kinematics.J_feet  # (3c)

        n, rate = problem.n, s / self._horizon
        for limit, bound in (
            (self._lower_rate, problem.lower[:n]),
            (self._upper_rate, problem.upper[:n]),
        ):
            np.subtract(limit, rate, out=bound)  # (3e), positions by forward Euler
            np.minimum(bound, self._speed, out=bound)
            np.maximum(bound, self._slowest, out=bound)
