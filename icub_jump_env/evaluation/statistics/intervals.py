"""How sure the results of some episodes are: intervals of 95 %."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, bootstrap, norm, trim_mean

Interval = tuple[float, float]

CONFIDENCE = 0.95

_RESAMPLES = 9999

interquartile_mean = functools.partial(trim_mean, proportiontocut=0.25)
"""Mean of the middle half, as reported of training seeds."""


def wilson_interval(count: int, total: int) -> Interval:
    """Wilson interval of a share."""
    interval = binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def paired_interval(won: int, lost: int, pairs: int) -> Interval:
    """Interval of the difference of two paired rates.

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
    """Percentile bootstrap interval of the mean, the same at each call."""
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
