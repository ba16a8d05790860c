"""What a sole can transmit: friction cone, unilateral force, centre of pressure (6f)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.config import ContactConfig
from icub_jump_env.control.tasks.task import Limit, LimitBuffers
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.icub import Sole
from icub_jump_env.robot.robot import Robot


class ContactLimits(Limit):
    """C u <= b for both feet, eq. (6f), with a least normal force."""

    size = 20

    def __init__(self, config: ContactConfig, robot: Robot) -> None:
        self._cone = contact_rows(config, robot.sole)
        self._minimum_force = config.minimum_force

    def prepare(self, buffers: LimitBuffers) -> None:
        """Write the rows and bounds of the wrenches, the last 12 unknowns."""
        for foot in range(2):
            rows = slice(10 * foot, 10 * foot + 10)
            first = buffers.rows.shape[1] - 12 + 6 * foot
            buffers.rows[rows, first : first + 6] = self._cone
        buffers.rows_upper[:] = 0.0
        buffers.lower[[-10, -4]] = self._minimum_force


class SmallWrenches:
    """1/2 w ||f||^2: makes the distribution of the contact wrenches over the feet unique."""

    def __init__(self, weight: float, n_joints: int) -> None:
        """Set up the task; the unknowns are n joint accelerations, then 12 wrench entries."""
        self.diagonal = np.zeros(n_joints + 12)
        self.diagonal[n_joints:] = weight

    def subtract(
        self, state: RobotState, setpoint: Setpoint, gradient: NDArray[np.float64]
    ) -> None:
        """Nothing: the goal is zero."""


def contact_rows(config: ContactConfig, sole: Sole) -> NDArray[np.float64]:
    """Rows of C f <= 0 for the wrench f = (force, moment) in a sole frame.

    The friction cone is a pyramid with sides along x and y. The moment is about the
    origin of the sole frame, the centre of pressure lies in the plane of the sole.

    Returns:
        (10, 6): four of friction, four of the CoP, two of torsion.
    """
    mu, torsion = config.friction, config.torsional_friction
    z = sole.bottom
    # CoP: x = (z F_x - M_y) / F_z and y = (z F_y + M_x) / F_z, inside the sole.
    return np.array(
        [
            [1.0, 0.0, -mu, 0.0, 0.0, 0.0],
            [-1.0, 0.0, -mu, 0.0, 0.0, 0.0],
            [0.0, 1.0, -mu, 0.0, 0.0, 0.0],
            [0.0, -1.0, -mu, 0.0, 0.0, 0.0],
            [z, 0.0, -sole.x_max, 0.0, -1.0, 0.0],
            [-z, 0.0, sole.x_min, 0.0, 1.0, 0.0],
            [0.0, z, -sole.half_width, 1.0, 0.0, 0.0],
            [0.0, -z, -sole.half_width, -1.0, 0.0, 0.0],
            [0.0, 0.0, -torsion, 0.0, 0.0, 1.0],
            [0.0, 0.0, -torsion, 0.0, 0.0, -1.0],
        ]
    )
