"""CoM velocity and angular momentum as asked for, without feedback: (3b) and (3d) at gain zero."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class CentroidalVelocity:
    """(J_c, J_M^omega) nu = (x_dot_dc, H_d)."""

    size = 6
    weight = scale = 1.0

    def __init__(
        self, kinematics: FeetFixedKinematics, com_weight: float, momentum_weight: float
    ) -> None:
        """Set up the task: weights in (m/s)^-2 and (kg m^2/s)^-2."""
        self._kinematics = kinematics
        self._root = np.sqrt([com_weight] * 3 + [momentum_weight] * 3)
        self._root_column = self._root[:, None]

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation, both sides times the roots of the weights."""
        np.multiply(self._kinematics.centroidal_map, self._root_column, out=rows)
        target[:3], target[3:] = setpoint.com_velocity, setpoint.angular_momentum
        target *= self._root
