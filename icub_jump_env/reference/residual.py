"""The learned residual: a target offset of the CoM reference, smoothed into a motion."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RESIDUAL_BANDWIDTH = 15.0
"""Natural frequency (rad/s) of the shaping filter: 90 % of a step within 0.26 s."""


class ResidualFilter:
    """Critically damped second-order filter with exact steps.

    Turns a piecewise constant target offset (m) into an offset with consistent velocity
    and acceleration: the velocity is the derivative of the offset, exactly, also
    between ticks. From rest, a zero target keeps all three at exactly zero.

    Attributes:
        offset: (3,) m, world axes (forward, lateral, vertical).
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
    """

    def __init__(self, bandwidth: float = RESIDUAL_BANDWIDTH) -> None:
        self._bandwidth = bandwidth
        self.offset = np.zeros(3)
        self.velocity = np.zeros(3)
        self.acceleration = np.zeros(3)

    def reset(self) -> None:
        """Return to rest at zero."""
        self.offset[:] = 0.0
        self.velocity[:] = 0.0
        self.acceleration[:] = 0.0

    def step(self, target: Array, dt: float) -> None:
        """Advance by ``dt`` seconds towards ``target`` ((3,) m)."""
        w = self._bandwidth
        decay = math.exp(-w * dt)
        error = self.offset - target
        slope = self.velocity + w * error
        error_next = (error + slope * dt) * decay
        self.velocity[:] = slope * decay - w * error_next
        self.offset[:] = target + error_next
        self.acceleration[:] = -w * w * error_next - 2 * w * self.velocity
