"""Torque controller: the QP of eq. 6, paper section III-E.

Unknowns are the joint accelerations and the contact wrenches of both feet, (s_ddot, f);
with the left foot at rest the base acceleration follows, and the torques are recovered
from the equations of motion. That is the paper's (tau, f) problem in other coordinates:
the CoM task and the momentum constraint become rows on f alone.

Dynamics, feet, limits, friction, unilateral force and CoP are hard. The CoM task (6b) and
the momentum constraint (6d) enter the cost with large weights, unless the configuration has
them hard, too; where they clash with a limit, the robot gives way in the order of the
weights: first posture and smoothness, then momentum and CoM; never a limit, a contact
constraint or the feet.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import TorqueConfig
from icub_jump_env.control.qp.problem import IDLE, QPReport, QPSolution, QuadraticProgram
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
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.records import Array, Block, Number, PerJoint, Record
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.limits import JointLimits
from icub_jump_env.robot.statics import Stance


class TorqueTerms(Record):
    """What eq. 6 has beside model, state and set point.

    Attributes:
        com_stiffness, com_damping, com_weight: K_p (1/s^2) and K_d (1/s) of (6b), and its weight
            ((m/s^2)^-2).
        momentum, momentum_weight: K (1/s) of (6d) and its weight (Nm^-2).
        posture_stiffness, posture_damping: K_p (1/s^2) and K_d (1/s) of (6a).
        posture_weight, smoothness_weight: (n,) Lambda and Delta of (6a).
        diagonal: (n + 12,) Lambda and the weight of small contact wrenches.
        speed_horizon, limit_horizon: Of (6e) (s).
        previous: (n,) previous torques (Nm).
    """

    com_stiffness: Number
    com_damping: Number
    com_weight: Number
    momentum: Number
    momentum_weight: Number
    posture_stiffness: Number
    posture_damping: Number
    posture_weight: PerJoint
    smoothness_weight: PerJoint
    diagonal: Annotated[Array, ("n + 12",)]
    speed_horizon: Number
    limit_horizon: Number
    previous: PerJoint


class TorqueQP:
    """Eq. 6 as a QP in (s_ddot, f), n + 12 variables.

    Attributes:
        problem: The QP; its rows: n torques, 20 contact constraints, then the equalities.
    """

    def __init__(
        self,
        config: TorqueConfig,
        terms: TorqueTerms,
        kinematics: FeetFixedKinematics,
        dynamics: FeetFixedDynamics,
        hard: bool,
    ) -> None:
        """Set up the QP.

        Args:
            config: Limits of the contacts, solver, and whether there is (6d).
            terms: Gains and weights, and what changes between ticks.
            kinematics: The model, which the estimator keeps up to date.
            dynamics: Equations of motion, which the controller keeps up to date.
            hard: Whether (6b) and (6d) are constraints, not costs.
        """
        robot, n = kinematics.robot, kinematics.robot.n_joints
        size, first = 6 if config.momentum_control else 3, n + 20
        self.problem = problem = QuadraticProgram(n + 12, first, 12 + size if hard else 12)
        of_rows = slice(n + 12 + n, n + 12 + first)
        limit_wrenches(
            config.contact,
            robot.sole,
            problem.C[n:first, n:],
            problem.lower[of_rows],
            problem.upper[of_rows],
            problem.lower[n : n + 12],
        )
        self._terms, self._hard = terms, hard
        self._kinematics, self._dynamics = kinematics, dynamics
        self._limits = JointLimits.of(robot)
        n_costs = n if hard else n + size
        self._rows, self._target = np.zeros((n_costs, n + 12)), np.zeros(n_costs)
        self._solver = CheckedSolver(config.solver, problem)

    def solve(self, state: RobotState, setpoint: Setpoint) -> tuple[QPSolution, QPReport]:
        """Pose the QP and solve it; apply the solution only if the report allows."""
        pose(
            self._kinematics.block, self._dynamics.block, self._limits.block, state.block,
            setpoint.block, self._terms.block, self._hard, self._rows, self._target,
            self.problem.block,
        )  # fmt: skip
        return self._solver.solve()


class TorqueController:
    """Joint torques that track the set point with the feet at rest.

    Attributes:
        report: How the latest tick's QP went.
        qp: Eq. 6.
        solution: (n + 12,) latest applied solution.
    """

    def __init__(self, config: TorqueConfig, kinematics: FeetFixedKinematics) -> None:
        """Set up the QP.

        Args:
            config: Gains, weights and limits.
            kinematics: The model, which the estimator keeps up to date.

        Raises:
            ConfigError: If weights do not fit the robot.
        """
        robot, n = kinematics.robot, kinematics.robot.n_joints
        self._dynamics = FeetFixedDynamics(kinematics)
        posture_weight = robot.per_joint("posture_weight", config.posture_weight)
        self._terms = TorqueTerms(
            {"n": n, "n + 12": n + 12},
            com_stiffness=config.com_stiffness,
            com_damping=config.com_damping,
            com_weight=config.com_weight,
            momentum=config.momentum,
            momentum_weight=config.momentum_weight,
            posture_stiffness=config.posture_stiffness,
            posture_damping=config.posture_damping,
            posture_weight=posture_weight,
            smoothness_weight=robot.per_joint("smoothness_weight", config.smoothness_weight),
            # Small wrenches make their distribution over the feet unique.
            diagonal=np.concatenate((posture_weight, np.full(12, config.wrench_weight))),
            speed_horizon=config.speed_horizon,
            limit_horizon=config.limit_horizon,
        )
        # Where eq. 6 as printed has no solution, the weighted form has one.
        kinds = [True, False] if config.constraints == "hard" else [False]
        self.qp, *self._fallback = (
            TorqueQP(config, self._terms, kinematics, self._dynamics, hard) for hard in kinds
        )
        self._limits = JointLimits.of(robot)
        self.solution = np.zeros(n + 12)
        self.report = IDLE

    def reset(self, stance: Stance) -> None:
        """Forget earlier ticks; the torques before the first one hold the stance."""
        self._terms.previous[:] = stance.torque
        self.solution[:] = 0.0
        self.report = IDLE

    def command(self, state: RobotState, setpoint: Setpoint) -> JointCommand:
        """One control tick.

        Args:
            state: The believed state, for which the kinematics are up to date.
            setpoint: What to track.

        Returns:
            (n,) joint torques (Nm) within the limits.
        """
        dynamics, torque = self._dynamics, self._terms.previous
        dynamics.update(state.joint_position, state.joint_velocity)
        solution, self.report = self.qp.solve(state, setpoint)
        solved = not self.report.failed
        for qp in self._fallback:
            if not solved:
                solution, report = qp.solve(state, setpoint)
                solved = not report.failed
        if solved:
            self.solution[:] = solution.x
            apply(dynamics.block, self._limits.block, self.solution, torque)
        return JointCommand(torque=torque.copy())


@compiled
def apply(dynamics: Block, limits: Block, solution: Array, torque: Array) -> None:
    """Torques (Nm) of a solution; the limits take the last rounding error off them."""
    d, largest = dynamics[0], limits[0].torque
    for i in range(torque.shape[0]):
        value = d.torque_bias[i]
        for j in range(solution.shape[0]):
            value += d.torque_rows[i, j] * solution[j]
        torque[i] = max(min(value, largest[i]), -largest[i])


@compiled
def pose(
    kinematics: Block,
    dynamics: Block,
    limits: Block,
    state: Block,
    setpoint: Block,
    terms: Block,
    hard: bool,
    rows: Array,
    target: Array,
    problem: Block,
) -> None:
    """Write eq. 6 as a QP in joint accelerations and contact wrenches.

    Args:
        kinematics: The model, up to date for the state.
        dynamics: Equations of motion, likewise.
        limits: Of the joints.
        state: The believed state.
        setpoint: What to track.
        terms: Block of the :class:`TorqueTerms`.
        hard: Whether (6b) and (6d) are constraints.
        rows: (k, n + 12) of the equations whose residual is a cost.
        target: (k,) their right sides.
        problem: Block of the QP.
    """
    model, motion, joint_limits, believed = kinematics[0], dynamics[0], limits[0], state[0]
    wanted, t, p = setpoint[0], terms[0], problem[0]
    n = t.previous.shape[0]
    n_x = n + 12
    equalities = n + 20
    lower, upper = p.lower[n_x:], p.upper[n_x:]
    p.g[:] = 0.0
    posture_acceleration(  # (6a)
        believed, wanted, t.posture_stiffness, t.posture_damping, t.posture_weight, p.g
    )
    torque_smoothness(motion, t.previous, t.smoothness_weight, rows[:n], target[:n])
    if hard:
        tasks, aims = p.C[equalities + 12 :], lower[equalities + 12 :]
        com_scale = momentum_scale = 1.0
    else:
        tasks, aims = rows[n:], target[n:]
        com_scale, momentum_scale = math.sqrt(t.com_weight), math.sqrt(t.momentum_weight)
    com_acceleration(  # (6b)
        motion, believed, wanted, t.com_stiffness, t.com_damping, com_scale, tasks[:3], aims[:3]
    )
    if aims.shape[0] > 3:
        momentum_rate(  # (6d)
            motion, believed, wanted, t.momentum, momentum_scale, tasks[3:], aims[3:]
        )
    least_squares(rows, target, t.diagonal, p.H, p.g)
    acceleration_limits(  # (6e)
        joint_limits, believed, t.speed_horizon, t.limit_horizon, p.lower[:n], p.upper[:n]
    )
    torque_limits(joint_limits, motion, p.C[:n], lower[:n], upper[:n])
    base_motion(motion, p.C[equalities : equalities + 6], lower[equalities : equalities + 6])
    feet_acceleration(  # (6c)
        model,
        motion,
        p.C[equalities + 6 : equalities + 12],
        lower[equalities + 6 : equalities + 12],
    )
    upper[equalities:] = lower[equalities:]
