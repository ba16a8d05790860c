"""One contender against another one on the same episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import PERCENT, number, spread
from icub_jump_env.evaluation.statistics.intervals import (
    Interval,
    bootstrap_interval,
    paired_interval,
)


@dataclass(frozen=True)
class Difference:
    """One contender against another one on the same episodes; intervals are of 95 %.

    Attributes:
        pairs: Number of episodes.
        won: Episodes that it alone succeeded in.
        lost: Episodes that the other one alone succeeded in.
        p_value: Of McNemar's exact test: how likely won and lost are to differ as much by
            chance.
        success: Gain in the success rate (1 is all episodes).
        success_interval: Its interval, see :func:`paired_interval`.
        rise: Gain in the mean flight height (m).
        rise_interval: Its bootstrap interval.
        sole_height: Gain in the mean height of the soles (m).
        sole_height_interval: Its bootstrap interval.
    """

    pairs: int
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
            pairs=len(gains),
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
        points = f"{PERCENT * self.success:+.1f}"
        rise, soles = (
            f"{number(value, 'cm', signed=True)} cm" for value in (self.rise, self.sole_height)
        )
        if self.pairs == 1:
            return f"success {points} points, rise {rise}, soles {soles} (a single episode)"
        low, high = (PERCENT * bound for bound in self.success_interval)
        p = "p < 0.001" if self.p_value < 0.001 else f"p = {self.p_value:.3f}"
        return (
            f"success {points} points (95 % interval {low:+.1f} to {high:+.1f}; "
            f"won {self.won}, lost {self.lost}, McNemar {p}), "
            f"rise {rise} ({spread(*self.rise_interval, 'cm', signed=True)}), "
            f"soles {soles} ({spread(*self.sole_height_interval, 'cm', signed=True)})"
        )


def _values(episodes: Sequence[Episode], metric: str) -> NDArray[np.float64]:
    """A height of each episode, zero where there was no flight."""
    return np.nan_to_num([float(episode.jump[metric]) for episode in episodes])
