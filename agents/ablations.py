"""How training seeds and ablations differ, on episodes that no training has seen.

    python -m agents.ablations --jobs 2

prints one row per kind of training in agents/pretrained/runs: the interquartile mean over
its seeds, and the bootstrap interval of 95 % where there are at least five. An interrupted
evaluation goes on where it stopped.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from agents.seeds import TEST
from agents.shipped import CURVE_SUFFIX, RUNS, judged_config
from icub_jump_env.checks import check_count
from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.contender import BASELINE, Contender, read_contenders
from icub_jump_env.evaluation.difference import bootstrap_interval
from icub_jump_env.evaluation.output import show
from icub_jump_env.evaluation.parallel import check_jobs
from icub_jump_env.evaluation.series import Series
from icub_jump_env.evaluation.summary import Summary, interquartile_mean
from icub_jump_env.evaluation.table import CM

_NAME = re.compile(r"(?P<kind>[\w-]+)-seed\d+")
_ENOUGH = 5
"""Seeds for a bootstrap interval to mean something."""

_EPISODES = 200


@dataclass(frozen=True)
class AblationOptions:
    """Compare kinds of training.

    Attributes:
        episodes: Of each policy.
        jobs: Processes that work in parallel.
    """

    episodes: int = _EPISODES
    jobs: int = 1

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1, len(TEST))
        check_count("jobs", self.jobs, 1)


def compare_trainings(options: AblationOptions) -> None:
    """Evaluate all runs and print the table."""
    console, progress = Console(), Console(stderr=True)
    check_jobs(options.jobs)
    files = sorted(RUNS.glob("*.safetensors"))
    if not files:
        raise ConfigError("runs", str(RUNS), "a folder with policies: python -m agents.evidence")
    kinds = defaultdict(list)
    for contender in read_contenders([str(file) for file in files]):
        if match := _NAME.fullmatch(contender.name):
            kinds[match["kind"]].append(contender)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in ("training", "seeds", "success, %", "interval", "rise, cm", "interval", "min"):
        table.add_column(column, justify="left" if column == "training" else "right")
    headline = get_args(ControllerName)
    for kind, members in sorted(kinds.items(), key=lambda item: item[0] not in headline):
        config = judged_config(members[0])
        if kind in headline:
            _add(table, f"{kind}, baseline", [_summary(config, BASELINE, options, progress)])
        summaries = [_summary(config, member, options, progress) for member in members]
        _add(table, kind, summaries, [_minutes(member.name) for member in members])
    table.caption = (
        f"seeds {TEST[0]} to {TEST[options.episodes - 1]}; interquartile mean over the training "
        "seeds and its bootstrap interval, which is of the training seeds alone and with five of "
        "them rather narrow"
    )
    table.caption_justify = "left"
    show(console, table)


def _summary(
    config: JumpConfig, contender: Contender, options: AblationOptions, progress: Console
) -> Summary:
    series = Series(config, TEST[: options.episodes], contender)
    return Summary.of(series.complete(options.jobs, progress))


def _minutes(name: str) -> float:
    """What a training took; NaN if that is not known of a part of it."""
    minutes = json.loads((RUNS / f"{name}{CURVE_SUFFIX}").read_text())["minutes"]
    return float(np.sum(np.array(minutes, dtype=float)))


def _add(
    table: Table, name: str, summaries: Sequence[Summary], minutes: Sequence[float] = ()
) -> None:
    known = [value for value in minutes if not math.isnan(value)]
    table.add_row(
        name,
        str(len(minutes) or "-"),
        *_cells(np.array([100 * s.success.share for s in summaries]), 1),
        *_cells(np.array([CM * s.mean_rise for s in summaries]), 2),
        f"{np.mean(known):.0f}" if known else "-",
    )


def _cells(values: NDArray[np.float64], decimals: int) -> tuple[str, str]:
    """Interquartile mean and interval."""
    interval = "-"
    if len(values) >= _ENOUGH:
        low, high = bootstrap_interval(values, interquartile_mean)
        interval = f"{low:.{decimals}f} to {high:.{decimals}f}"
    return f"{interquartile_mean(values):.{decimals}f}", interval


if __name__ == "__main__":
    guarded(lambda: compare_trainings(parse(AblationOptions, sys.argv[1:])))
