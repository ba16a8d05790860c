"""CoM velocity and angular momentum of a landing: (3b) and (3d) without gains of their own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class CentroidalVelocity:
    """(J_c, J_M^omega) nu + e = (x_dot_dc, H_d): a constraint, and a cost on its residual e.

    The residual is six unknowns more, after the joint velocities. So the Hessian stays diagonal
    and constant, which takes less time than products of rows and a dense one.

    Attributes:
        diagonal: (n + 6,) weights of the unknowns.
    """

    size = 6
    weight = scale = 1.0

    def __init__(
        self, kinematics: FeetFixedKinematics, com_weight: float, momentum_weight: float
    ) -> None:
        """Set up the task: weights of e in (m/s)^-2 and (kg m^2/s)^-2."""
        self._kinematics, self._n = kinematics, kinematics.robot.n_joints
        self.diagonal = np.zeros(self._n + self.size)
        self.diagonal[self._n :] = [com_weight] * 3 + [momentum_weight] * 3
        self._identity = np.eye(self.size)

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        rows[:, : self._n] = self._kinematics.centroidal_map
        rows[:, self._n :] = self._identity
        target[:3], target[3:] = setpoint.com_velocity, setpoint.angular_momentum

    def subtract(self, state: RobotState, setpoint: Setpoint, gradient: Array) -> None:
        """The residual shall be zero."""
