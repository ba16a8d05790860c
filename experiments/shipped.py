"""What the trainings leave, what is shipped of it, and the jumps to judge it by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import Contender

REPOSITORY = Path(__file__).parents[1]

RUNS = REPOSITORY / "experiments" / "runs"
"""The best policy of every training, and its learning curve."""

CURVE_SUFFIX = ".curve.json"
"""End of the names of the curves."""


def judged_config(contender: Contender) -> JumpConfig:
    """The commands and worlds of its training."""
    assert contender.card is not None  # it was read from a file
    return contender.card.config


def selection_of(contender: Contender) -> Mapping[str, Any]:
    """The evaluation that made this policy the best of its run."""
    assert contender.card is not None  # it was read from a file
    evaluation: Mapping[str, Any] = contender.card.results["evaluation"]
    return evaluation


def best_of(contenders: Sequence[Contender]) -> Contender:
    """That with the largest mean reward in the evaluation that chose it."""
    return max(contenders, key=lambda contender: selection_of(contender)["score"])
