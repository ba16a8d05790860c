"""Reward terms of one step; their sum is the reward."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.metrics.jump import JumpMetrics

LANDED_REWARD = 1.0
HEIGHT_REWARD = 2.0
"""Most is to be won here: almost every jump lands."""
ROTATION_COST = 1.0
"""Per rad of flight rotation."""
RESIDUAL_COST = 0.001
"""Per step and unit of squared action."""


def reward_terms(
    metrics: JumpMetrics,
    jump_height: float,
    action: NDArray[np.float64],
    ends: bool,
) -> dict[str, float]:
    """The named reward terms.

    Three terms come with the last step of an episode: ``reward_landed`` (1 for a robot
    that landed and stands), ``reward_height`` (2 for a flight of the commanded height, less
    in proportion to the distance from it, at least 0) and ``reward_rotation`` (minus the flight rotation in rad, at
    least -1). ``reward_residual`` charges each step in which the residual acts for its size.

    Args:
        metrics: Metrics so far.
        jump_height: Commanded height (m).
        action: (3,) action in [-1, 1].
        ends: Whether the episode ended with this step.

    Returns:
        Term by name.
    """
    landed = height = rotation = 0.0
    if ends:
        landed = LANDED_REWARD * metrics.landed
        error = abs(metrics.flight_height - jump_height) / jump_height
        height = HEIGHT_REWARD * max(0.0, 1.0 - error)
        if not math.isnan(metrics.flight_rotation):
            rotation = -min(1.0, ROTATION_COST * abs(metrics.flight_rotation))
    return {
        "reward_landed": float(landed),
        "reward_height": float(height),
        "reward_rotation": float(rotation),
        "reward_residual": -RESIDUAL_COST * float(action @ action),
    }
