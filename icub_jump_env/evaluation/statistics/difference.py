"""One contender against another one on the same episodes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import PERCENT, number, probability, spread
from icub_jump_env.evaluation.statistics.intervals import (
    Interval,
    bootstrap_interval,
    paired_interval,
)


@dataclass(frozen=True)
class RateDifference:
    """One rate against another one of the same episodes.

    Attributes:
        pairs: Number of episodes.
        won: Episodes that only ours counts.
        lost: Episodes that only theirs counts.
        p_value: Of McNemar's exact test: how likely won and lost are to differ as much by
            chance.
        gain: Our rate minus theirs (1 is all episodes).
        interval: Its interval of 95 %, see :func:`paired_interval`.
        corrected_p_value: As in :class:`Difference`.
    """

    pairs: int
    won: int
    lost: int
    p_value: float
    gain: float
    interval: Interval
    corrected_p_value: float | None = None

    @classmethod
    def of(
        cls,
        ours: Sequence[Episode],
        theirs: Sequence[Episode],
        counts: Callable[[Episode], bool],
    ) -> RateDifference:
        """The difference of two lists with the same seeds in the same order.

        Args:
            ours: Episodes of the one.
            theirs: Episodes of the other one.
            counts: Whether an episode counts.

        Raises:
            ValueError: If the seeds differ.
        """
        if [episode.seed for episode in ours] != [episode.seed for episode in theirs]:
            raise ValueError("pairs of episodes have the same seeds in the same order")
        gains = [int(counts(o)) - int(counts(t)) for o, t in zip(ours, theirs, strict=True)]
        won, lost = gains.count(1), gains.count(-1)
        return cls(
            pairs=len(gains),
            won=won,
            lost=lost,
            p_value=float(binomtest(won, won + lost).pvalue) if won + lost else 1.0,
            gain=(won - lost) / len(gains),
            interval=paired_interval(won, lost, len(gains)),
        )

    @property
    def sign(self) -> int:
        """1 if the interval lies above zero, -1 if below, 0 if it holds zero."""
        low, high = self.interval
        return int(low > 0.0) - int(high < 0.0)


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
        corrected_p_value: The p-value, corrected for the other comparisons made with this one;
            None if there are none, see :func:`holm_corrected`.
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
    corrected_p_value: float | None = None

    @classmethod
    def of(cls, ours: Sequence[Episode], theirs: Sequence[Episode]) -> Difference:
        """The difference of two lists with the same seeds in the same order.

        Raises:
            ValueError: If the seeds differ.
        """
        rate = RateDifference.of(ours, theirs, lambda episode: episode.is_success)
        rises, soles = (
            _values(ours, metric) - _values(theirs, metric)
            for metric in ("flight_height", "sole_height")
        )
        return cls(
            pairs=rate.pairs,
            won=rate.won,
            lost=rate.lost,
            p_value=rate.p_value,
            success=rate.gain,
            success_interval=rate.interval,
            rise=float(rises.mean()),
            rise_interval=bootstrap_interval(rises),
            sole_height=float(soles.mean()),
            sole_height_interval=bootstrap_interval(soles),
        )

    def __str__(self) -> str:
        points = f"{PERCENT * self.success:+z.1f}"
        rise, soles = (
            f"{number(value, 'cm', signed=True)} cm" for value in (self.rise, self.sole_height)
        )
        if self.pairs == 1:
            return f"success {points} points, rise {rise}, soles {soles} (a single episode)"
        low, high = (PERCENT * bound for bound in self.success_interval)
        p = _shown(self.p_value)
        if self.corrected_p_value is not None:
            p += f", corrected {_shown(self.corrected_p_value)}"
        return (
            f"success {points} points (95 % interval {low:+z.1f} to {high:+z.1f}; "
            f"won {self.won}, lost {self.lost}, McNemar {p}), "
            f"rise {rise} ({spread(*self.rise_interval, 'cm', signed=True)}), "
            f"soles {soles} ({spread(*self.sole_height_interval, 'cm', signed=True)})"
        )


AnyDifference = TypeVar("AnyDifference", Difference, RateDifference)


def holm_corrected(differences: Sequence[AnyDifference]) -> list[AnyDifference]:
    """The same differences, their p-values corrected for being several by Holm's method.

    The smallest of n is multiplied by n, the next one by n - 1, and so on; none gets smaller
    than the one before it. A single one needs no correction.
    """
    if len(differences) < 2:
        return list(differences)
    p_values = np.array([difference.p_value for difference in differences])
    order = np.argsort(p_values)
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    corrected[order] = np.minimum(np.maximum.accumulate(factors * p_values[order]), 1.0)
    return [
        dataclasses.replace(difference, corrected_p_value=float(p_value))
        for difference, p_value in zip(differences, corrected, strict=True)
    ]


def in_words(differences: Mapping[str, Difference]) -> list[str]:
    """A line for each difference, and what corrects their p-values.

    Args:
        differences: All that one command reports, corrected, by what is compared.
    """
    lines = [f"{names}: {difference}" for names, difference in differences.items()]
    tested = [d for d in differences.values() if d.corrected_p_value is not None and d.pairs > 1]
    if tested:
        lines.append(f"corrected p: Holm-corrected over {len(tested)} comparisons")
    return lines


def _shown(p_value: float) -> str:
    text = probability(p_value)
    return f"p {text}" if text.startswith("<") else f"p = {text}"


def _values(episodes: Sequence[Episode], metric: str) -> NDArray[np.float64]:
    """A height of each episode, zero where there was no flight."""
    return np.nan_to_num([float(episode.jump[metric]) for episode in episodes])
