"""Command line of ``icub-jump bench``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from icub_jump_env.benchmark.cases import CASES, EPISODES, FIRST_SEED, SET_BY_THE_BENCHMARK
from icub_jump_env.benchmark.results import Result, Score
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, InvalidValueError
from icub_jump_env.evaluation.cli import contenders_of, guarded, read_options
from icub_jump_env.evaluation.episodes.cluster import Jobs
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.evaluation.quantities import CM, PERCENT
from icub_jump_env.evaluation.report.output import check_writable, new_table, say, show
from icub_jump_env.evaluation.report.provenance import provenance
from icub_jump_env.robot.kinematics import FeetFixedKinematics

USAGE = """\
icub-jump bench FILE.json ...       jump the benchmark and write the result
icub-jump bench --table FILE ...    a table of results
... are options of icub-jump eval that say what jumps: --env ICubJump-v1 --policy torque --jobs 2\
"""


def bench(arguments: Sequence[str]) -> None:
    """Run ``icub-jump bench`` with these arguments."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        return
    guarded(lambda: _bench(*arguments))


def _bench(first: str, *words: str) -> None:
    console, progress = Console(), Console(stderr=True)
    if first == "--table":
        if not words:
            raise InvalidValueError("--table", None, "files")
        show(console, leaderboard([Result.read(Path(word)) for word in words]))
        return
    if first.startswith("-"):
        raise InvalidValueError("bench", first, "a file before options")
    options = read_options(words)
    _check_free(options.config)
    (contender,) = contenders_of(options)
    check_writable("bench", Path(first))
    result = jump(options.config, contender, EPISODES, options.workers, progress)
    result.write(Path(first))
    show(console, details(result))
    say(progress, f"wrote {first}")


def _check_free(config: JumpConfig) -> None:
    for field in SET_BY_THE_BENCHMARK:
        value, default = getattr(config, field), getattr(JumpConfig(), field)
        if value != default:
            raise ConfigError(field, value, "left to the benchmark")


def jump(
    config: JumpConfig, contender: Contender, episodes: int, jobs: Jobs, progress: Console
) -> Result:
    """Jump all cases; an interrupted run goes on where it stopped.

    Args:
        config: The entry, but for what the cases set.
        contender: What acts in it.
        episodes: Of each case.
        jobs: Number of worker processes, or a cluster.
        progress: Where the progress is shown.
    """
    standing = standing_height(config)
    scores = {}
    for number, (name, case) in enumerate(CASES.items()):
        first = FIRST_SEED + number * EPISODES
        series = Series(case.of(config), range(first, first + episodes), contender)
        scores[name] = Score.of(series.complete(jobs, progress), standing)
    source = provenance(config, FIRST_SEED) | {"policy": contender.identity}
    return Result(f"{config.controller_name}, {contender.name}", scores, source)


def standing_height(config: JumpConfig) -> float:
    """Height of the CoM (m) of the robot that stands upright, all joints at zero."""
    kinematics = FeetFixedKinematics(config.robot_value)
    kinematics.update(np.zeros(config.robot_value.n_joints))
    return float(kinematics.com[2])


def details(result: Result) -> Table:
    """A row for each case."""
    table = new_table(
        1, "case", "", "success, %", "95 %", "rise, cm", "above standing, cm", "failed",
        title=f"Jump benchmark: {result.entry}",
    )  # fmt: skip
    for name, score in result.scores.items():
        failed = ", ".join(f"{n} {kind}" for kind, n in score.failures.items())
        table.add_row(
            name, CASES[name].meaning, f"{PERCENT * score.success.share:.0f}", score.success.bounds,
            *map(_cm, (score.rise, score.above_standing)), failed,
        )  # fmt: skip
    mean, (low, high) = result.total
    table.add_section()
    table.add_row(
        "all",
        "mean of the cases",
        f"{PERCENT * mean:.1f}",
        f"{PERCENT * low:.1f} to {PERCENT * high:.1f}",
    )
    return table


def leaderboard(results: Sequence[Result]) -> Table:
    """A row for each result, the best first."""
    table = new_table(1, "entry", "all, %", "95 %", *CASES, title="Jump benchmark: success, %")
    for result in sorted(results, key=lambda result: -result.total[0]):
        mean, (low, high) = result.total
        table.add_row(
            result.entry, f"{PERCENT * mean:.1f}", f"{PERCENT * low:.1f} to {PERCENT * high:.1f}",
            *(f"{PERCENT * score.success.share:.0f}" for score in result.scores.values()),
        )  # fmt: skip
    return table


def _cm(height: float) -> str:
    return "-" if math.isnan(height) else f"{CM * height:.2f}"
