"""The learning curve of a run: its evaluations, one after the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from icub_jump_env.checks import check_count, check_number, check_type
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import commands
from icub_jump_env.evaluation.statistics.summary import Summary, by_command
from icub_jump_env.files import read_json

from .checkpoints import CheckpointError

_LARGEST_SCORE = 1e6
"""No mean reward comes near it."""


def check_progress(number: int, progress: Mapping[str, Any]) -> tuple[int, list[dict[str, Any]]]:
    """Updates and learning curve, as a checkpoint noted them.

    Raises:
        CheckpointError: If it did not.
    """
    try:
        updates = check_count("updates", progress.get("updates"), 0, unit="updates")
        curve = progress.get("curve")
        if not isinstance(curve, list) or len(curve) != number:
            raise ConfigError("curve", curve, f"a list of {number} evaluations")
        for point in curve:
            check_type("point of the curve", point, dict)
            check_number("score", point.get("score"), -_LARGEST_SCORE, _LARGEST_SCORE)
    except ConfigError as error:
        raise CheckpointError(f"checkpoint {number}: {error}") from None
    return updates, curve


def read_minutes(file: Path, count: int) -> list[float | None]:
    """What the first evaluations took; unknown if the file is gone, for it is a mere report."""
    try:
        minutes = read_json(file.read_bytes())["minutes"]
        return [None if value is None else float(value) for value in minutes[:count]]
    except (OSError, ValueError, TypeError, KeyError):
        return [None] * count


def curve_point(timesteps: int, episodes: Sequence[Episode]) -> dict[str, Any]:
    """A point of the learning curve."""
    summary = Summary.of(episodes)
    return {
        "timesteps": timesteps,
        "episodes": len(episodes),
        "score": float(np.mean([episode.reward for episode in episodes])),
        "success": summary.success.share,
        "landed": summary.landed.share,
        "rise": summary.mean_rise,
        "rotation": None if math.isnan(summary.median_rotation) else summary.median_rotation,
        "success_by_command": {
            commands(*bounds): Summary.of(group).success.share
            for bounds, group in by_command(episodes).items()
        },
    }
