"""CoM reference of the launching phase: planned trajectory plus residual."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.reference.com_trajectory import ComTrajectory
from icub_jump_env.reference.residual import ResidualFilter

Array = NDArray[np.float64]


class ComReference:
    """Where the CoM should be, in the world frame.

    Attributes:
        position: (3,) x_dc (m).
        velocity: (3,) its derivative (m/s).
        acceleration: (3,) its second derivative (m/s^2).
        residual: The shaped residual that is part of the above.
    """

    def __init__(self) -> None:
        self.position = np.zeros(3)
        self.velocity = np.zeros(3)
        self.acceleration = np.zeros(3)
        self.residual = ResidualFilter()
        self._start = np.zeros(3)
        self._trajectory: ComTrajectory

    def reset(self, trajectory: ComTrajectory, start: Array) -> None:
        """Begin a jump with the CoM at ``start`` ((3,) m)."""
        self._trajectory = trajectory
        self._start[:] = start
        self.residual.reset()
        self.update(0.0)

    def update(self, time: float) -> None:
        """Set the reference for ``time`` (s) after the start of the launch."""
        residual, rise = self.residual, self._trajectory.sample(time)
        self.position[:] = self._start + residual.offset
        self.velocity[:] = residual.velocity
        self.acceleration[:] = residual.acceleration
        self.position[2] += rise.position
        self.velocity[2] += rise.velocity
        self.acceleration[2] += rise.acceleration
