"""Reward terms of one step; their sum is the reward."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number, store
from icub_jump_env.metrics.series import Jump


@dataclass(frozen=True)
class RewardConfig:
    """Weights of the reward terms.

    Attributes:
        landed: For a robot that landed and stands.
        height: For a flight of the commanded height. Most is to be won here: almost every
            jump lands.
        rotation: Per rad of flight rotation.
        residual: Per step and unit of squared action.

    Raises:
        ConfigError: If a value is out of range.
    """

    landed: float = 1.0
    height: float = 2.0
    rotation: float = 1.0
    residual: float = 0.001

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            weight = check_number(field.name, getattr(self, field.name), 0.0, 1e6)
            store(self, **{field.name: weight})


def reward_terms(
    ended: Iterable[Jump], action: NDArray[np.float64], weights: RewardConfig
) -> dict[str, float]:
    """The named reward terms.

    Three terms come with the last step of a jump: ``reward_landed`` (for a robot that
    landed and stands), ``reward_height`` (for a flight of the commanded height, less in
    proportion to the distance from it, at least 0) and ``reward_rotation`` (minus the
    weighted flight rotation, at least -1). ``reward_residual`` charges each step in which the residual acts for its size.

    Args:
        ended: The jumps that ended with this step.
        action: The action, in [-1, 1].
        weights: Weights of the terms.

    Returns:
        Term by name.
    """
    landed = height = rotation = 0.0
    for jump in ended:
        metrics = jump.metrics
        landed += weights.landed * metrics.landed
        error = abs(metrics.flight_height - jump.height) / jump.height
        height += weights.height * max(0.0, 1.0 - error)
        if not math.isnan(metrics.flight_rotation):
            rotation -= min(1.0, weights.rotation * abs(metrics.flight_rotation))
    return {
        "reward_landed": float(landed),
        "reward_height": float(height),
        "reward_rotation": float(rotation),
        "reward_residual": -weights.residual * float(action @ action),
    }
