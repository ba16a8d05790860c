"""Velocity controller: the QP of eq. 3, paper section III-D.

With the feet at rest (eq. 3c) the base velocity follows from the joints, so the QP is
posed in the joint velocities. Limits and feet are hard; the CoM task (3b) and the
momentum constraint (3d) enter the cost with large weights, unless the configuration has
them hard, too. As long as no limit is in the way the weighted form is eq. 3 to within the
ratio of the weights. Where tasks and limits clash, the robot gives way in the order of the
weights: first posture and smoothness, then momentum, then the CoM; never a limit, never
the feet.
"""

from __future__ import annotations

import math

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import SolverName, VelocityConfig
from icub_jump_env.control.qp.problem import IDLE, QPReport, QPSolution, QuadraticProgram
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.control.tasks.com import com_velocity
from icub_jump_env.control.tasks.feet import feet_velocity
from icub_jump_env.control.tasks.least_squares import least_squares
from icub_jump_env.control.tasks.limits import velocity_limits
from icub_jump_env.control.tasks.momentum import momentum_integral
from icub_jump_env.control.tasks.posture import posture_velocity
from icub_jump_env.control.tasks.smoothness import velocity_smoothness
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.records import Array, Block, Number, PerJoint, Record, Vector
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.limits import JointLimits
from icub_jump_env.robot.statics import Stance


class VelocityTerms(Record):
    """What eq. 3 has beside model, state and set point.

    Attributes:
        com, com_weight: K (1/s) of (3b) and its weight ((m/s)^-2).
        momentum, momentum_weight: K (1/s) of (3d) and its weight ((kg m^2/s)^-2).
        posture: K_p (1/s) of (3a).
        posture_weight, smoothness_weight: (n,) Lambda and Delta of (3a).
        horizon, margin: T (s) of (3e), and the share of the speed limits that may be used.
        lift: Vertical speed of the right sole relative to the left one (m/s); zero in (3c).
        dt: Control period (s).
        previous: (n,) previous command (rad/s).
        integral: (3,) integral of the momentum (kg m^2).
    """

    com: Number
    com_weight: Number
    momentum: Number
    momentum_weight: Number
    posture: Number
    posture_weight: PerJoint
    smoothness_weight: PerJoint
    horizon: Number
    margin: Number
    lift: Number
    dt: Number
    previous: PerJoint
    integral: Vector


class VelocityQP:
    """Eq. 3 as a QP in the n joint velocities.

    Attributes:
        problem: The QP.
    """

    def __init__(
        self,
        terms: VelocityTerms,
        kinematics: FeetFixedKinematics,
        solver: SolverName,
        *,
        hard: bool = False,
        momentum: bool = True,
    ) -> None:
        """Set up the QP.

        Args:
            terms: Gains and weights, and what changes between ticks.
            kinematics: The model, which the estimator keeps up to date.
            solver: QP solver.
            hard: Whether (3b) and (3d) are constraints, not costs.
            momentum: Whether there is (3d).
        """
        n, size = len(terms.previous), 6 if momentum else 3
        self.problem = QuadraticProgram(n, 0, 6 + size if hard else 6)
        self.problem.H[:] = np.diag(terms.posture_weight + terms.smoothness_weight)
        self._terms, self._hard, self._kinematics = terms, hard, kinematics
        self._limits = JointLimits.of(kinematics.robot)
        n_costs = 0 if hard else size
        self._rows, self._target = np.zeros((n_costs, n)), np.zeros(n_costs)
        self._solver = CheckedSolver(solver, self.problem)

    def solve(self, state: RobotState, setpoint: Setpoint) -> tuple[QPSolution, QPReport]:
        """Pose the QP and solve it; apply the solution only if the report allows."""
        pose(
            self._kinematics.block, self._limits.block, state.block, setpoint.block,
            self._terms.block, self._hard, self._rows, self._target, self.problem.block,
        )  # fmt: skip
        return self._solver.solve()


class VelocityController:
    """Joint velocities that track the set point with the feet at rest.

    Attributes:
        report: How the latest tick's QP went.
        qp: Eq. 3.
    """

    def __init__(self, config: VelocityConfig, kinematics: FeetFixedKinematics) -> None:
        """Set up the QP.

        Args:
            config: Gains, weights and limits.
            kinematics: The model, which the estimator keeps up to date.

        Raises:
            ConfigError: If weights do not fit the robot.
        """
        robot, dt = kinematics.robot, 1.0 / config.frequency
        self._terms = VelocityTerms(
            {"n": robot.n_joints},
            com=config.com,
            com_weight=config.com_weight,
            momentum=config.momentum,
            momentum_weight=config.momentum_weight,
            posture=config.posture,
            posture_weight=robot.per_joint("posture_weight", config.posture_weight),
            smoothness_weight=robot.per_joint("smoothness_weight", config.smoothness_weight),
            horizon=max(config.limit_horizon, dt),
            margin=config.velocity_margin,
            dt=dt,
        )
        # Where eq. 3 as printed has no solution, the weighted form has one.
        kinds = [True, False] if config.constraints == "hard" else [False]
        self.qp, *self._fallback = (
            VelocityQP(
                self._terms, kinematics, config.solver, hard=hard, momentum=config.momentum_control
            )
            for hard in kinds
        )
        self.report = IDLE

    def reset(self, stance: Stance) -> None:
        """Forget the previous command and the momentum integral; the robot stands at rest."""
        self._terms.previous[:] = 0.0
        self._terms.integral[:] = 0.0
        self.report = IDLE

    def command(self, state: RobotState, setpoint: Setpoint) -> JointCommand:
        """One control tick.

        Args:
            state: The believed state, for which the model is up to date.
            setpoint: What to track.

        Returns:
            (n,) joint velocities (rad/s) within the limits.
        """
        sum_up(state.block, setpoint.block, self._terms.block)
        solution, self.report = self.qp.solve(state, setpoint)
        solved = not self.report.failed
        for qp in self._fallback:
            if not solved:
                solution, report = qp.solve(state, setpoint)
                solved = not report.failed
        # Keeping on is the best guess when the solver has none.
        command = self._terms.previous
        limit(solution.x if solved else command, self.qp.problem.block, command)
        return JointCommand(command.copy())


@compiled
def limit(velocity: Array, problem: Block, command: Array) -> None:
    """Take the last rounding error off a solution, by the QP's limits, unless those are NaN."""
    p = problem[0]
    for j in range(command.shape[0]):
        value = velocity[j]
        if value > p.upper[j]:
            value = p.upper[j]
        if value < p.lower[j]:
            value = p.lower[j]
        command[j] = value


@compiled
def sum_up(state: Block, setpoint: Block, terms: Block) -> None:
    """Add to the integral of (3d)."""
    for i in range(3):
        error = state[0].angular_momentum[i] - setpoint[0].angular_momentum[i]
        terms[0].integral[i] += terms[0].dt * error


@compiled
def pose(
    kinematics: Block,
    limits: Block,
    state: Block,
    setpoint: Block,
    terms: Block,
    hard: bool,
    rows: Array,
    target: Array,
    problem: Block,
) -> None:
    """Write eq. 3 as a QP in the joint velocities.

    Args:
        kinematics: The model, up to date for the state.
        limits: Of the joints.
        state: The believed state.
        setpoint: What to track.
        terms: Block of the :class:`VelocityTerms`.
        hard: Whether (3b) and (3d) are constraints.
        rows: (k, n) of the equations whose residual is a cost.
        target: (k,) their right sides.
        problem: Block of the QP.
    """
    model, joint_limits, believed, wanted = kinematics[0], limits[0], state[0], setpoint[0]
    t, p = terms[0], problem[0]
    n = p.g.shape[0]
    p.g[:] = 0.0
    posture_velocity(believed, wanted, t.posture, t.posture_weight, p.g)  # (3a)
    velocity_smoothness(t.previous, t.smoothness_weight, p.g)
    if hard:
        tasks, aims = p.C[6:], p.lower[n + 6 :]
        com_scale = momentum_scale = 1.0
    else:
        tasks, aims = rows[:], target[:]
        com_scale, momentum_scale = math.sqrt(t.com_weight), math.sqrt(t.momentum_weight)
    com_velocity(model, wanted, t.com, com_scale, tasks[:3], aims[:3])  # (3b)
    if aims.shape[0] > 3:
        momentum_integral(  # (3d)
            model, t.integral, wanted, t.momentum, momentum_scale, tasks[3:], aims[3:]
        )
    if not hard:
        least_squares(rows, target, t.posture_weight + t.smoothness_weight, p.H, p.g)
    feet_velocity(model, t.lift, p.C[:6], p.lower[n : n + 6])  # (3c)
    velocity_limits(joint_limits, believed, t.horizon, t.margin, p.lower[:n], p.upper[:n])  # (3e)
    p.upper[n:] = p.lower[n:]
