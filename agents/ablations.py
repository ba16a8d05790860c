"""How training seeds and ablations differ, on episodes that no training has seen.

    python -m agents.ablations --jobs 2

prints one row per kind of training in agents/pretrained/runs: the interquartile mean over
its seeds, and the bootstrap interval of 95 % where there are at least five. An interrupted
evaluation goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from agents.options import TASK
from agents.seeds import TEST
from icub_jump_env.checks import check_count
from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.contender import BASELINE, Contender, as_trained, read_contenders
from icub_jump_env.evaluation.difference import bootstrap_interval
from icub_jump_env.evaluation.output import show
from icub_jump_env.evaluation.parallel import check_jobs
from icub_jump_env.evaluation.series import Series
from icub_jump_env.evaluation.summary import Summary, interquartile_mean
from icub_jump_env.evaluation.table import CM

PRETRAINED = Path("agents/pretrained")
"""Shipped policies."""
RUNS = PRETRAINED / "runs"
"""The best policy of every training, and its learning curve."""
CURVES = ".curve.json"
"""End of the names of the curves."""

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
    for kind, members in kinds.items():
        config = _config(members[0])
        if kind in get_args(ControllerName):
            _add(table, f"{kind}, baseline", [_summary(config, BASELINE, options, progress)])
        summaries = [_summary(config, member, options, progress) for member in members]
        _add(table, kind, summaries, float(np.mean([_minutes(m.name) for m in members])))
    table.caption = (
        f"seeds {TEST[0]} to {TEST[options.episodes - 1]}; intervals cover the chance in the "
        "training seed, not that in the episodes"
    )
    table.caption_justify = "left"
    show(console, table)


def _config(contender: Contender) -> JumpConfig:
    """The worlds and commands of the headline runs, and what this policy depends on."""
    assert contender.card is not None  # it was read from a file
    return dataclasses.replace(
        as_trained(contender.card), jump_height=TASK.jump_height, randomization=TASK.randomization
    )


def _summary(
    config: JumpConfig, contender: Contender, options: AblationOptions, progress: Console
) -> Summary:
    series = Series(config, TEST[: options.episodes], contender)
    return Summary.of(series.complete(options.jobs, progress))


def _minutes(name: str) -> float:
    """What a training took; NaN if it was interrupted by more than a pause."""
    minutes = json.loads((RUNS / f"{name}{CURVES}").read_text())["minutes"]
    return float(np.sum(np.array(minutes, dtype=float)))


def _add(
    table: Table, name: str, summaries: Sequence[Summary], minutes: float | None = None
) -> None:
    table.add_row(
        name,
        str(len(summaries)) if minutes is not None else "-",
        *_cells(np.array([100 * s.success.share for s in summaries]), 1),
        *_cells(np.array([CM * s.mean_rise for s in summaries]), 2),
        f"{minutes:.0f}" if minutes is not None else "-",
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
