"""The equations of motion of the base, six rows of eq. (1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.dynamics import FeetFixedDynamics

Array = NDArray[np.float64]


class BaseMotion:
    """The rows of M nu_dot + h = B tau + J_f f that no motor drives."""

    size = 6
    weight = scale = 1.0

    def __init__(self, dynamics: FeetFixedDynamics) -> None:
        self._dynamics = dynamics

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        rows[:] = self._dynamics.base_rows
        target[:] = self._dynamics.base_bias
