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

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import VelocityConfig
from icub_jump_env.control.qp.problem import IDLE
from icub_jump_env.control.tasks.com import ComVelocity
from icub_jump_env.control.tasks.feet import FeetVelocity
from icub_jump_env.control.tasks.limits import VelocityLimits
from icub_jump_env.control.tasks.momentum import MomentumIntegral
from icub_jump_env.control.tasks.posture import PostureVelocity
from icub_jump_env.control.tasks.smoothness import VelocitySmoothness
from icub_jump_env.control.tasks.stack import TaskQP
from icub_jump_env.control.tasks.task import Task
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.statics import Stance

Array = NDArray[np.float64]


class VelocityController:
    """Joint velocities that track the set point with the feet at rest.

    Attributes:
        report: How the latest tick's QP went.
        qp: The QP in the n joint velocities.
    """

    def __init__(self, config: VelocityConfig, kinematics: FeetFixedKinematics) -> None:
        """Set up the QP.

        Args:
            config: Gains, weights and limits.
            kinematics: The model, which the estimator keeps up to date.

        Raises:
            ConfigError: If weights do not fit the robot.
        """
        self._config, self._kinematics = config, kinematics
        robot = kinematics.robot
        self._dt = 1.0 / config.frequency
        self._previous = np.zeros(robot.n_joints)
        self._integral = np.zeros(3)
        self._posture_weight = robot.per_joint("posture_weight", config.posture_weight)
        self._smoothness_weight = robot.per_joint("smoothness_weight", config.smoothness_weight)
        self.report = IDLE
        self.qp = self._make_qp(hard=config.constraints == "hard")
        # Where eq. 3 as printed has no solution, the weighted form has one.
        self._fallback = self._make_qp(hard=False) if config.constraints == "hard" else None

    def _make_qp(self, hard: bool) -> TaskQP:
        config, kinematics = self._config, self._kinematics
        robot = kinematics.robot
        feet = FeetVelocity(kinematics)
        tasks: list[Task] = [ComVelocity(kinematics, config.com, config.com_weight)]
        if config.momentum_control:
            tasks.append(
                MomentumIntegral(
                    kinematics, config.momentum, config.momentum_weight, self._integral
                )
            )
        horizon = max(config.limit_horizon, self._dt)
        return TaskQP(
            robot.n_joints,
            costs=[
                PostureVelocity(config.posture, self._posture_weight),
                VelocitySmoothness(self._smoothness_weight, self._previous),
            ],
            soft=[] if hard else tasks,
            hard=[*tasks, feet] if hard else [feet],
            limits=[VelocityLimits(robot, horizon, config.velocity_margin)],
            solver=config.solver,
        )

    def reset(self, stance: Stance) -> None:
        """Forget the previous command and the momentum integral; the robot stands at rest."""
        self._previous[:] = 0.0
        self._integral[:] = 0.0
        self.report = IDLE

    def command(self, state: RobotState, setpoint: Setpoint) -> JointCommand:
        """One control tick.

        Args:
            state: The believed state, for which the model is up to date.
            setpoint: What to track.

        Returns:
            (n,) joint velocities (rad/s) within the limits.
        """
        error = state.angular_momentum - setpoint.angular_momentum
        error *= self._dt
        self._integral += error
        solution, self.report = self.qp.solve(state, setpoint)
        solved = not self.report.failed
        if not solved and self._fallback is not None:
            solution, report = self._fallback.solve(state, setpoint)
            solved = not report.failed
        # Keeping on is the best guess when the solver has none. The limits take the
        # last rounding error off a solution; fmin and fmax pass over NaN limits.
        command, problem = self._previous, self.qp.problem
        if solved:
            command[:] = solution.x
        np.fmin(command, problem.upper[: problem.n], out=command)
        np.fmax(command, problem.lower[: problem.n], out=command)
        return JointCommand(command.copy())
