"""The policy that leaves the controller alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Baseline:
    """No residual: the pure controller."""

    def __call__(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Zero, whatever the observation."""
        return np.zeros(3, np.float32)


BASELINE = Baseline()
