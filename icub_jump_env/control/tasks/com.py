"""The CoM task: (3b) in velocities, (6b) in accelerations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.dynamics import GRAVITY, FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class ComVelocity:
    """J_c nu = x_dot_dc - K (x - x_dc), eq. (3b)."""

    size = 3

    def __init__(self, kinematics: FeetFixedKinematics, gain: float, weight: float) -> None:
        """Set up the task: ``gain`` is K (1/s), ``weight`` in (m/s)^-2."""
        self._kinematics, self._gain = kinematics, gain
        self.weight, self.scale = weight, 1.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        np.multiply(self._kinematics.J_com, self.scale, out=rows)
        error = state.com - setpoint.com_position
        error *= self._gain
        np.subtract(setpoint.com_velocity, error, out=target)
        target *= self.scale


class ComAcceleration:
    """J_c nu_dot + J_c_dot nu = x_ddot_dc - [K_p K_d] (x - x_dc, x_dot - x_dot_dc), eq. (6b).

    By Newton's law it reads F / m + g = x_ddot for the total contact force F, which makes it
    rows on the contact wrenches alone, here in the axes of the base. The paper prints the
    gains as diag(K_p, K_d), which would return six numbers for three.
    """

    size = 3

    def __init__(
        self, dynamics: FeetFixedDynamics, stiffness: float, damping: float, weight: float
    ) -> None:
        """Set up the task.

        Args:
            dynamics: Equations of motion, up to date when the task is written.
            stiffness: K_p (1/s^2).
            damping: K_d (1/s).
            weight: Weight of the residual ((m/s^2)^-2).
        """
        self._dynamics = dynamics
        self._stiffness, self._damping = stiffness, damping
        self.weight, self.scale = weight, 1.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        dynamics = self._dynamics
        per_mass = self.scale / dynamics.mass
        np.multiply(dynamics.force_rows, per_mass, out=rows[:, -12:])
        wanted = setpoint.com_acceleration - GRAVITY
        wanted -= self._stiffness * (state.com - setpoint.com_position)
        wanted -= self._damping * (state.com_velocity - setpoint.com_velocity)
        np.dot(wanted, state.base_rotation, out=target)
        target *= per_mass * dynamics.mass
