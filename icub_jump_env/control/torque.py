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

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import TorqueConfig
from icub_jump_env.control.qp.problem import IDLE
from icub_jump_env.control.tasks.com import ComAcceleration
from icub_jump_env.control.tasks.contact import ContactLimits, SmallWrenches
from icub_jump_env.control.tasks.feet import FeetAcceleration
from icub_jump_env.control.tasks.limits import AccelerationLimits, TorqueLimits
from icub_jump_env.control.tasks.momentum import MomentumRate
from icub_jump_env.control.tasks.motion import BaseMotion
from icub_jump_env.control.tasks.posture import PostureAcceleration
from icub_jump_env.control.tasks.smoothness import TorqueSmoothness
from icub_jump_env.control.tasks.stack import TaskQP
from icub_jump_env.control.tasks.task import Task
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.statics import Stance

Array = NDArray[np.float64]


class TorqueController:
    """Joint torques that track the set point with the feet at rest.

    Attributes:
        report: How the latest tick's QP went.
        qp: The QP in (s_ddot, f), n + 12 variables; rows: n torques, 20 contact
            constraints, then the equalities.
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
        self._config, self._kinematics = config, kinematics
        self._robot = robot = kinematics.robot
        self._dynamics = FeetFixedDynamics(kinematics)
        self._previous = np.zeros(robot.n_joints)
        self._posture_weight = robot.per_joint("posture_weight", config.posture_weight)
        self._smoothness_weight = robot.per_joint("smoothness_weight", config.smoothness_weight)
        self.solution = np.zeros(robot.n_joints + 12)
        self.report = IDLE
        self.qp = self._make_qp(hard=config.constraints == "hard")
        # Where eq. 6 as printed has no solution, the weighted form has one.
        self._fallback = self._make_qp(hard=False) if config.constraints == "hard" else None

    def _make_qp(self, hard: bool) -> TaskQP:
        config, robot, dynamics = self._config, self._robot, self._dynamics
        n = robot.n_joints + 12
        standing: list[Task] = [
            BaseMotion(dynamics),
            FeetAcceleration(self._kinematics, dynamics),
        ]
        tasks: list[Task] = [
            ComAcceleration(dynamics, config.com_stiffness, config.com_damping, config.com_weight)
        ]
        if config.momentum_control:
            tasks.append(MomentumRate(dynamics, config.momentum, config.momentum_weight))
        smoothness = TorqueSmoothness(dynamics, self._smoothness_weight, self._previous)
        return TaskQP(
            n,
            costs=[
                PostureAcceleration(
                    config.posture_stiffness, config.posture_damping, self._posture_weight
                ),
                SmallWrenches(config.wrench_weight, robot.n_joints),
            ],
            soft=[smoothness] if hard else [smoothness, *tasks],
            hard=[*standing, *tasks] if hard else standing,
            limits=[
                AccelerationLimits(robot, config.speed_horizon, config.limit_horizon),
                TorqueLimits(dynamics, robot),
                ContactLimits(config.contact, robot),
            ],
            solver=config.solver,
        )

    def reset(self, stance: Stance) -> None:
        """Forget earlier ticks; the torques before the first one hold the stance."""
        self._previous[:] = stance.torque
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
        dynamics, torque = self._dynamics, self._previous
        dynamics.update(state.joint_position, state.joint_velocity)
        solution, self.report = self.qp.solve(state, setpoint)
        solved = not self.report.failed
        if not solved and self._fallback is not None:
            solution, report = self._fallback.solve(state, setpoint)
            solved = not report.failed
        if solved:
            self.solution[:] = solution.x
            np.add(dynamics.torque_rows.dot(solution.x), dynamics.torque_bias, out=torque)
            np.minimum(torque, self._robot.effort_limit, out=torque)
            np.maximum(torque, -self._robot.effort_limit, out=torque)
        return JointCommand(torque=torque.copy())
