"""What a policy is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Policy(Protocol):
    """Chooses the action of each step.

    A policy has no memory: equal observations, equal actions. The time, which replaying
    needs, is in the observation.
    """

    def __call__(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Choose an action.

        Args:
            observation: As laid out in :mod:`icub_jump_env.observation`; 80 entries by default.

        Returns:
            One entry in [-1, 1] for each of ``residual_axes``; the caller's own.
        """
        ...
