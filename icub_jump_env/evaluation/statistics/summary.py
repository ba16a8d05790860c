"""What some episodes say together."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import CM, PERCENT, QUANTITIES, commands
from icub_jump_env.evaluation.statistics.intervals import Interval, wilson_interval

_METRICS = (
    *(metric for _, metric, _ in QUANTITIES),
    "landing_force",
    "joint_work",
    "solver_failures",
    "self_collisions",
)


@dataclass(frozen=True)
class Rate:
    """A share of episodes with its Wilson interval."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """Observed share."""
        return self.count / self.total

    @property
    def interval(self) -> Interval:
        """Wilson interval of 95 %."""
        return wilson_interval(self.count, self.total)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"count": self.count, "total": self.total, "interval": self.interval}

    def __str__(self) -> str:
        if self.total == 1:
            return "yes" if self.count else "no"
        return (
            f"{PERCENT * self.share:.1f} % ({self.count} of {self.total}; "
            f"95 % interval {self.bounds} %)"
        )

    @property
    def bounds(self) -> str:
        """The interval in percent; a dash for a single episode."""
        low, high = self.interval
        return "-" if self.total == 1 else f"{PERCENT * low:.1f} to {PERCENT * high:.1f}"


@dataclass(frozen=True)
class Summary:
    """What a set of episodes says, in whatever order they are.

    Attributes:
        success: At least 0.7 of the commanded height, and landed.
        landed: Landed and stands.
        mean_rise: Mean flight height (m) of all episodes: the CoM's rise after take-off.
        mean_sole_height: Mean height of the soles (m); zero without a flight. It tells a higher
            jump from an earlier take-off.
        mean_height_error: Mean distance of the flight height from the command (m).
        median_rotation: Median size of the rotation in flight (rad); NaN without a flight.
        percentiles: 10th, 50th and 90th percentile of each metric, SI units, over the
            episodes where it is defined; NaN if there is none.
        failures: Seeds of the failed episodes by class.
    """

    success: Rate
    landed: Rate
    mean_rise: float
    mean_sole_height: float
    mean_height_error: float
    median_rotation: float
    percentiles: Mapping[str, tuple[float, float, float]]
    failures: Mapping[Failure, tuple[int, ...]]

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> Summary:
        """The summary of some episodes."""
        values = {
            metric: np.sort([float(episode.jump[metric]) for episode in episodes])
            for metric in _METRICS
        }
        errors = np.sort([abs(e.jump["flight_height"] - e.jump_height) for e in episodes])
        failures = {
            kind: tuple(sorted(e.seed for e in episodes if e.failure is kind)) for kind in Failure
        }
        return cls(
            success=Rate(sum(e.is_success for e in episodes), len(episodes)),
            landed=Rate(sum(e.landed for e in episodes), len(episodes)),
            mean_rise=float(values["flight_height"].mean()),
            mean_sole_height=float(np.nan_to_num(values["sole_height"]).mean()),
            mean_height_error=float(errors.mean()),
            median_rotation=_percentiles(np.abs(values["flight_rotation"]))[1],
            percentiles={metric: _percentiles(found) for metric, found in values.items()},
            failures={kind: seeds for kind, seeds in failures.items() if seeds},
        )

    def median(self, metric: str) -> float:
        """Median of a metric, over the episodes where it is defined."""
        return self.percentiles[metric][1]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"success": self.success.as_dict(), "landed": self.landed.as_dict()}


def landed_in_a_row(episodes: Sequence[Episode], jumps: int) -> str:
    """How many jumps of a series of ``jumps`` landed, from the first on; one line."""
    landed = [episode.series["landed"] for episode in episodes]
    complete = Rate(landed.count(jumps), len(landed))
    mean = sum(landed) / len(landed)
    return f"jumps landed in a row: {mean:.3g} of {jumps}; complete series: {complete}"


def _percentiles(values: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, float, float]:
    defined = values[~np.isnan(values)]
    if not defined.size:
        return math.nan, math.nan, math.nan
    p10, p50, p90 = np.percentile(defined, [10, 50, 90])
    return float(p10), float(p50), float(p90)


Command = tuple[float, float]
"""The whole centimetres that a command lies between (m)."""


def command_range(jump_height: float) -> Command:
    """The whole centimetres that a command (m) lies between."""
    low = math.floor(CM * jump_height + 1e-9)
    return low / CM, (low + 1) / CM


def by_command(episodes: Sequence[Episode]) -> dict[Command, list[Episode]]:
    """Episodes by the centimetres that their command lies between, ascending."""

    def key(episode: Episode) -> Command:
        return command_range(episode.jump_height)

    groups = itertools.groupby(sorted(episodes, key=key), key=key)
    return {command: list(group) for command, group in groups}


def command_labels(episodes: Sequence[Episode]) -> dict[Command, str]:
    """What to call the groups of :func:`by_command`; a single command by itself."""
    groups, heights = by_command(episodes), [episode.jump_height for episode in episodes]
    if min(heights) == max(heights):
        return dict.fromkeys(groups, commands(min(heights), max(heights)))
    return {command: commands(*command) for command in groups}
