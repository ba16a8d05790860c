"""What a controller hands to the joint servos, and what it says about itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.qp import QPResiduals, QPStatus

Array = NDArray[np.float64]


class JointCommand(NamedTuple):
    """Command to the joint servos, valid until the next control tick.

    Attributes:
        velocity: (23,) desired joint velocities (rad/s).
        position: (23,) desired joint positions (rad) now, or ``None`` for velocity
            control, where the servo integrates the velocity itself.
    """

    velocity: Array
    position: Array | None = None


class QPReport(NamedTuple):
    """How the QP of a control tick went.

    Attributes:
        status: Status after the check of the residuals.
        residuals: Residuals computed outside the solver.
        iterations: Solver iterations.
    """

    status: QPStatus
    residuals: QPResiduals
    iterations: int

    @property
    def failed(self) -> bool:
        """Whether the solution was not applied."""
        return self.status is not QPStatus.SOLVED
