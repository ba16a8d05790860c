"""How training seeds and ablations differ, on episodes that no training has seen.

    python -m experiments.ablations --jobs 2
    python -m experiments.ablations --task v0 --jobs 2

prints one row per kind of training in experiments/runs: what it reaches and what it
gains over the baseline of its task, with the law where the task has it. An interrupted
evaluation goes on where it stopped.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TEST
from experiments.shipped import CURVE_SUFFIX, RUNS, judged_config
from icub_jump_env.checks import check_choice, check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender, read_contenders
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT, seeds
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.evaluation.statistics.intervals import CONFIDENCE, interquartile_mean

_NAME = re.compile(r"(?P<kind>[\w-]+)-seed\d+")
Task = Literal["v0", "disturbed"]
HEADLINES: Mapping[Task, tuple[str, ...]] = MappingProxyType(
    {"v0": CONTROLLERS, "disturbed": tuple(f"disturbed-{name}" for name in CONTROLLERS)}
)
"""Kinds of training that others are ablations of, by task."""

_EPISODES = 200
_RESAMPLES = 5000

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AblationOptions:
    """Compare kinds of training.

    Attributes:
        task: Of which task: that of disturbed worlds, or that of ICubJump-v0.
        episodes: Of each policy.
        jobs: Processes that work in parallel.
    """

    task: Task = "disturbed"
    episodes: int = _EPISODES
    jobs: int = 1

    def __post_init__(self) -> None:
        check_choice("task", self.task, tuple(HEADLINES))
        check_count("episodes", self.episodes, 1, len(TEST))
        check_count("jobs", self.jobs, 1, unit="processes")


def compare_trainings(options: AblationOptions) -> None:
    """Evaluate all runs and print the table."""
    console, progress = Console(), Console(stderr=True)
    files = sorted(RUNS.glob("*.safetensors"))
    if not files:
        raise ConfigError(
            "runs", str(RUNS), "a folder with policies: python -m experiments.evidence"
        )
    kinds = defaultdict(list)
    for contender in read_contenders([str(file) for file in files]):
        if match := _NAME.fullmatch(contender.name):
            kinds[match["kind"]].append(contender)
    table = new_table(
        1,
        "training",
        "seeds",
        "success, %",
        "gain",
        "rise, cm",
        "gain",
        "soles, cm",
        "gain",
        "min",
    )
    for headline in (kind for kind in HEADLINES[options.task] if kind in kinds):
        baseline = _jumps(judged_config(kinds[headline][0]), BASELINE, options, progress)
        _add(table, f"{headline}, baseline", baseline)
        for kind in sorted(kind for kind in kinds if kind.startswith(headline)):
            members = kinds[kind]
            jumps = np.stack(
                [_jumps(judged_config(member), member, options, progress) for member in members]
            )
            name = f"{kind} (single seed)" if len(members) == 1 else kind
            _add(table, name, jumps, baseline, [_minutes(member.name) for member in members])
    table.caption = (
        f"{seeds(TEST[: options.episodes])}; interquartile means over the training "
        "seeds; gain over the baseline in the same episodes, with its bootstrap interval of 95 %: "
        "over training seeds and episodes (of few seeds: too narrow rather than too wide); single "
        "seed: over the episodes of one training alone, so another seed may well differ by more"
    )
    show(console, table)


def _jumps(
    config: JumpConfig, contender: Contender, options: AblationOptions, progress: Console
) -> Array:
    """Success (%), rise and height of the soles (cm) of each episode (3, n)."""
    series = Series(config, TEST[: options.episodes], contender)
    return jumps_of(series.complete(options.jobs, progress))


def jumps_of(episodes: Sequence[Episode]) -> Array:
    """Success (%), rise and height of the soles (cm) of each episode (3, n)."""
    found = [
        (PERCENT * e.is_success, CM * e.jump["flight_height"], CM * e.jump["sole_height"])
        for e in episodes
    ]
    jumps: Array = np.nan_to_num(found).T  # without a flight: no height
    return jumps


def _minutes(name: str) -> float:
    """What a training took; NaN if that is not known of a part of it."""
    minutes = json.loads((RUNS / f"{name}{CURVE_SUFFIX}").read_text())["minutes"]
    return float(np.sum(np.array(minutes, dtype=float)))


def _add(
    table: Table,
    name: str,
    jumps: Array,
    baseline: Array | None = None,
    minutes: Sequence[float] = (),
) -> None:
    """A row: jumps (seeds, 3, n) against those of the baseline (3, n)."""
    known = [value for value in minutes if not math.isnan(value)]
    each = jumps.reshape(-1, *jumps.shape[-2:])
    cells = cells_of(each, None if baseline is None else each - baseline)
    table.add_row(
        name, str(len(minutes) or "-"), *cells, f"{np.mean(known):.0f}" if known else "-"
    )


def cells_of(jumps: Array, gains: Array | None, confidence: float = CONFIDENCE) -> list[str]:
    """Cells of a table: of each quantity its mean over training seeds, and the gain in it.

    Args:
        jumps: Success, rise and soles of each training in each episode (seeds, 3, n).
        gains: What is gained in them, likewise; None where nothing is compared.
        confidence: Of the intervals.
    """
    cells = []
    for quantity, decimals in enumerate((1, 2, 2)):
        mean = interquartile_mean(jumps[:, quantity].mean(axis=1))
        cells.append(f"{mean:.{decimals}f}")
        if gains is None:
            cells.append("-")
            continue
        gained = gains[:, quantity]
        values = (interquartile_mean(gained.mean(axis=1)), *runs_interval(gained, confidence))
        gain, low, high = (f"{value:+z.{decimals}f}" for value in values)
        cells.append(f"{gain} ({low} to {high})")
    return cells


def runs_interval(gains: Array, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Interval of the interquartile mean over training seeds, the same at each call.

    A percentile bootstrap that draws both training seeds and episodes anew.

    Args:
        gains: Of each training in each episode (seeds, n).
        confidence: Of the interval.
    """
    rng = np.random.default_rng(0)
    runs, episodes = gains.shape
    means = [
        gains[np.ix_(rng.integers(runs, size=runs), rng.integers(episodes, size=episodes))].mean(
            axis=1
        )
        for _ in range(_RESAMPLES)
    ]
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(interquartile_mean(means, axis=1), [tail, 100.0 - tail])
    return float(low), float(high)


if __name__ == "__main__":
    guarded(lambda: compare_trainings(parse(AblationOptions, sys.argv[1:])))
