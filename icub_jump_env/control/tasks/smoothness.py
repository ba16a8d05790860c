"""Closeness to the previous command, second term of (3a) and (6a)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.dynamics import FeetFixedDynamics

Array = NDArray[np.float64]


class VelocitySmoothness:
    """1/2 ||s_dot - s_dot_{k-1}||^2_Delta, eq. (3a)."""

    def __init__(self, weight: Array, previous: Array) -> None:
        """Set up the task.

        Args:
            weight: (n,) diagonal of Delta.
            previous: (n,) live view of the previous command (rad/s).
        """
        self.diagonal = weight
        self._previous = previous

    def subtract(self, state: RobotState, setpoint: Setpoint, gradient: Array) -> None:
        """Subtract Delta s_dot_{k-1} from the gradient."""
        gradient -= self.diagonal * self._previous


class TorqueSmoothness:
    """1/2 ||tau - tau_{k-1}||^2_Delta, eq. (6a); tau is affine in the unknowns.

    The paper's text speaks of the difference of accelerations; we take the formula.
    """

    def __init__(self, dynamics: FeetFixedDynamics, weight: Array, previous: Array) -> None:
        """Set up the task.

        Args:
            dynamics: Equations of motion, up to date when the task is written.
            weight: (n,) diagonal of Delta (Nm^-2).
            previous: (n,) live view of the previous torques (Nm).
        """
        self.size = len(weight)
        self.weight = self.scale = 1.0
        self._dynamics, self._previous = dynamics, previous
        self._root = np.sqrt(weight)
        self._root_column = self._root[:, None]

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write sqrt(Delta) tau(x) = sqrt(Delta) tau_{k-1}."""
        np.multiply(self._root_column, self._dynamics.torque_rows, out=rows)
        np.subtract(self._previous, self._dynamics.torque_bias, out=target)
        target *= self._root
