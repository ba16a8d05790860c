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
            observation: (80,) as laid out in :mod:`icub_jump_env.observation`.

        Returns:
            (3,) in [-1, 1]: forward, lateral, vertical; the caller's own.
        """
        ...
