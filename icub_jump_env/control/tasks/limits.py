"""Limits of the joints: (3e) in velocities, (6e) in accelerations and torques."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.tasks.task import Limit, LimitBuffers
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]


class VelocityLimits(Limit):
    """s_dot^- <= s_dot <= s_dot^+ and s^- <= s + T s_dot <= s^+, eq. (3e).

    The paper takes one control period for the horizon T, in which no joint can stop.
    """

    def __init__(self, robot: Robot, horizon: float, margin: float) -> None:
        """Set up the limit.

        Args:
            robot: Whose limits they are.
            horizon: T (s).
            margin: Share of the speed limits that may be used.
        """
        self._fastest = robot.velocity_limit * margin
        self._slowest = -self._fastest
        self._horizon, self._n = horizon, robot.n_joints
        self._lowest = robot.lower_position / horizon
        self._highest = robot.upper_position / horizon

    def write(self, state: RobotState, buffers: LimitBuffers) -> None:
        """Write the bounds of the joint velocities."""
        rate = state.joint_position / self._horizon
        for limit, bound in (
            (self._lowest, buffers.lower[: self._n]),
            (self._highest, buffers.upper[: self._n]),
        ):
            np.subtract(limit, rate, out=bound)
            np.minimum(bound, self._fastest, out=bound)
            np.maximum(bound, self._slowest, out=bound)


class AccelerationLimits(Limit):
    """s_dot^- <= s_dot <= s_dot^+, s^- <= s <= s^+ after a horizon each, eq. (6e).

    At the decided s_ddot the speed after its horizon, and s + T s_dot + T^2/2 s_ddot, are
    within their limits; where both cannot be, the speed is.
    """

    def __init__(self, robot: Robot, speed_horizon: float, position_horizon: float) -> None:
        """Set up the limit; horizons in s."""
        self._robot = robot
        self._speed_horizon, self._horizon = speed_horizon, position_horizon
        self._per_acceleration = 2.0 / position_horizon**2

    def write(self, state: RobotState, buffers: LimitBuffers) -> None:
        """Write the bounds of the joint accelerations."""
        robot, s_dot = self._robot, state.joint_velocity
        n = len(s_dot)
        drift = state.joint_position + self._horizon * s_dot
        slowest = (-robot.velocity_limit - s_dot) / self._speed_horizon
        fastest = (robot.velocity_limit - s_dot) / self._speed_horizon
        for limit, bound in (
            (robot.lower_position, buffers.lower[:n]),
            (robot.upper_position, buffers.upper[:n]),
        ):
            np.multiply(limit - drift, self._per_acceleration, out=bound)
            np.maximum(bound, slowest, out=bound)
            np.minimum(bound, fastest, out=bound)


class TorqueLimits(Limit):
    """tau^- <= tau <= tau^+, eq. (6e)."""

    def __init__(self, dynamics: FeetFixedDynamics, robot: Robot) -> None:
        self.size = robot.n_joints
        self._dynamics = dynamics
        self._highest, self._lowest = robot.effort_limit, -robot.effort_limit

    def write(self, state: RobotState, buffers: LimitBuffers) -> None:
        """Write tau(x) and its bounds."""
        dynamics = self._dynamics
        buffers.rows[:] = dynamics.torque_rows
        np.subtract(self._lowest, dynamics.torque_bias, out=buffers.rows_lower)
        np.subtract(self._highest, dynamics.torque_bias, out=buffers.rows_upper)
