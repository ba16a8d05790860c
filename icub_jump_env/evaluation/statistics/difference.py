"""One contender against another one on the same episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, bootstrap, norm

from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.statistics.summary import CONFIDENCE
from icub_jump_env.evaluation.quantities import CM

Interval = tuple[float, float]

_RESAMPLES = 9999


@dataclass(frozen=True)
class Difference:
    """One contender against another one on the same episodes.

    Attributes:
        won: Episodes that it alone succeeded in.
        lost: Episodes that the other one alone succeeded in.
        p_value: Of McNemar's exact test: how likely won and lost are to differ as much by
            chance.
        success: Gain in the success rate (1 is all episodes).
        success_interval: Its interval of 95 %, see :func:`paired_interval`.
        rise: Gain in the mean flight height (m).
        rise_interval: Its bootstrap interval of 95 %.
        sole_height: Gain in the mean height of the soles (m).
        sole_height_interval: Its bootstrap interval of 95 %.
    """

    won: int
    lost: int
    p_value: float
    success: float
    success_interval: Interval
    rise: float
    rise_interval: Interval
    sole_height: float
    sole_height_interval: Interval

    @classmethod
    def of(cls, ours: Sequence[Episode], theirs: Sequence[Episode]) -> Difference:
        """The difference of two lists with the same seeds in the same order.

        Raises:
            ValueError: If the seeds differ.
        """
        if [episode.seed for episode in ours] != [episode.seed for episode in theirs]:
            raise ValueError("pairs of episodes have the same seeds in the same order")
        gains = np.array([o.is_success - t.is_success for o, t in zip(ours, theirs, strict=True)])
        won, lost = int((gains > 0).sum()), int((gains < 0).sum())
        rises, soles = (
            _values(ours, metric) - _values(theirs, metric)
            for metric in ("flight_height", "sole_height")
        )
        return cls(
            won=won,
            lost=lost,
            p_value=float(binomtest(won, won + lost).pvalue) if won + lost else 1.0,
            success=float(gains.mean()),
            success_interval=paired_interval(won, lost, len(gains)),
            rise=float(rises.mean()),
            rise_interval=bootstrap_interval(rises),
            sole_height=float(soles.mean()),
            sole_height_interval=bootstrap_interval(soles),
        )

    def __str__(self) -> str:
        low, high = (100 * bound for bound in self.success_interval)
        p = "p < 0.001" if self.p_value < 0.001 else f"p = {self.p_value:.3f}"
        return (
            f"success {100 * self.success:+.1f} points (95 % interval {low:+.1f} to {high:+.1f}; "
            f"won {self.won}, lost {self.lost}, McNemar {p}), "
            f"rise {_centimetres(self.rise, self.rise_interval)}, "
            f"soles {_centimetres(self.sole_height, self.sole_height_interval)}"
        )


def paired_interval(won: int, lost: int, pairs: int) -> Interval:
    """Interval of 95 % of the difference of two paired rates.

    Wald's with half a pair added to each of the four outcomes, which keeps its coverage
    near 95 % also where few pairs differ, or none.

    Reference: Agresti and Min, Simple improved confidence intervals for comparing matched
    proportions, Statistics in Medicine 24, 2005.

    Args:
        won: Pairs that the first one alone succeeded in.
        lost: Pairs that the second one alone succeeded in.
        pairs: All pairs.
    """
    n = pairs + 2
    middle = (won - lost) / n
    variance = ((won + lost + 1) / n - middle**2) / n
    half = float(norm.ppf((1 + CONFIDENCE) / 2)) * math.sqrt(variance)
    return max(-1.0, middle - half), min(1.0, middle + half)


def bootstrap_interval(values: NDArray[Any]) -> Interval:
    """Percentile bootstrap interval of 95 % of the mean, the same at each call."""
    if np.ptp(values) == 0.0:
        return float(values[0]), float(values[0])
    interval = bootstrap(
        (values,),
        np.mean,
        n_resamples=_RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)


def _values(episodes: Sequence[Episode], metric: str) -> NDArray[np.float64]:
    """A height of each episode, zero where there was no flight."""
    return np.nan_to_num([float(episode.jump[metric]) for episode in episodes])


def _centimetres(value: float, interval: Interval) -> str:
    low, high = interval
    return f"{CM * value:+.2f} cm ({CM * low:+.2f} to {CM * high:+.2f})"
