"""The constraint on the centroidal angular momentum: (3d) in velocities, (6d) in forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class MomentumIntegral:
    """J_M^omega nu = H_d - K int (H_omega - H_d) dt, eq. (3d); the paper's H_d is zero."""

    size = 3

    def __init__(
        self, kinematics: FeetFixedKinematics, gain: float, weight: float, integral: Array
    ) -> None:
        """Set up the task.

        Args:
            kinematics: The model, up to date when the task is written.
            gain: K (1/s).
            weight: Weight of the residual ((kg m^2/s)^-2).
            integral: (3,) live view of the integral, which the controller sums up.
        """
        self._kinematics, self._gain, self._integral = kinematics, gain, integral
        self.weight, self.scale = weight, 1.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        np.multiply(self._kinematics.J_momentum, self.scale, out=rows)
        np.multiply(self._integral, -self._gain, out=target)
        target += setpoint.angular_momentum
        target *= self.scale


class MomentumRate:
    """A f = H_dot_d - K (H_omega - H_d), eq. (6d); the paper's H_d is zero.

    A f is the moment of the contact wrenches about the CoM, here in the axes of the base.
    """

    size = 3

    def __init__(self, dynamics: FeetFixedDynamics, gain: float, weight: float) -> None:
        """Set up the task: ``gain`` is K (1/s), ``weight`` in Nm^-2."""
        self._dynamics, self._gain = dynamics, gain
        self.weight, self.scale = weight, 1.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        np.multiply(self._dynamics.moment_rows, self.scale, out=rows[:, -12:])
        wanted = setpoint.angular_momentum - state.angular_momentum
        np.dot(wanted, state.base_rotation, out=target)
        target *= self.scale * self._gain
        target += np.dot(setpoint.angular_momentum_rate, state.base_rotation) * self.scale
