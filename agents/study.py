"""How training seeds and ablations differ, on episodes that no training has seen.

    python -m agents.study --jobs 2

prints one row per kind of training in agents/pretrained/runs: the interquartile mean over
its seeds, and the bootstrap interval of 95 % where there are at least five. An interrupted
study goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.stats import trim_mean

from agents.options import TASK
from icub_jump_env.checks import check_count
from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.contender import BASELINE, Contender, as_trained, read_contenders
from icub_jump_env.evaluation.difference import bootstrap_interval
from icub_jump_env.evaluation.output import show
from icub_jump_env.evaluation.series import Series
from icub_jump_env.evaluation.summary import Summary
from icub_jump_env.evaluation.table import CM

RUNS = Path("agents/pretrained/runs")
TEST_SEEDS = range(2000, 2200)
"""Neither trained on nor chosen by."""

_NAME = re.compile(r"(?P<group>[\w-]+)-seed\d+")
_ENOUGH = 5
"""Seeds for a bootstrap interval to mean something."""


@dataclass(frozen=True)
class StudyOptions:
    """Compare kinds of training.

    Attributes:
        episodes: Of each policy.
        jobs: Processes that work in parallel.
    """

    episodes: int = len(TEST_SEEDS)
    jobs: int = 1

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1)
        check_count("jobs", self.jobs, 1)


def study(options: StudyOptions) -> None:
    """Evaluate all runs and print the table."""
    console, progress = Console(), Console(stderr=True)
    if not any(RUNS.glob("*.safetensors")):
        raise ConfigError("runs", str(RUNS), "a folder with policies: python -m agents.evidence")
    groups = defaultdict(list)
    for contender in read_contenders([str(file) for file in sorted(RUNS.glob("*.safetensors"))]):
        if match := _NAME.fullmatch(contender.name):
            groups[match["group"]].append(contender)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in ("training", "seeds", "success, %", "interval", "rise, cm", "interval"):
        table.add_column(column, justify="left" if column == "training" else "right")
    for name, members in groups.items():
        config = _config(members[0])
        if name in get_args(ControllerName):
            _add(table, f"{name}, baseline", [_summary(config, BASELINE, options, progress)])
        _add(table, name, [_summary(config, member, options, progress) for member in members])
    show(console, table)


def _config(contender: Contender) -> JumpConfig:
    """The worlds and commands of the headline runs, and what this policy depends on."""
    assert contender.card is not None  # it was read from a file
    return dataclasses.replace(
        as_trained(contender.card), jump_height=TASK.jump_height, randomization=TASK.randomization
    )


def _add(table: Table, name: str, summaries: Sequence[Summary]) -> None:
    cells = [name, str(len(summaries))]
    for values in (
        np.array([100 * s.success.share for s in summaries]),
        np.array([CM * s.mean_rise for s in summaries]),
    ):
        decimals = 1 if values.mean() > 10 else 2
        cells.append(f"{trim_mean(values, 0.25):.{decimals}f}")
        if len(values) >= _ENOUGH:
            low, high = bootstrap_interval(values, partial(trim_mean, proportiontocut=0.25))
            cells.append(f"{low:.{decimals}f} to {high:.{decimals}f}")
        else:
            cells.append("-")
    table.add_row(*cells)


def _summary(
    config: JumpConfig, contender: Contender, options: StudyOptions, progress: Console
) -> Summary:
    seeds = range(TEST_SEEDS.start, TEST_SEEDS.start + options.episodes)
    series = Series(config, seeds, contender)
    return Summary.of(series.complete(options.jobs, progress))


if __name__ == "__main__":
    guarded(lambda: study(parse(StudyOptions, sys.argv[1:])))
