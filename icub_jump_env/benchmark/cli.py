"""Command line of ``icub-jump bench``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from icub_jump_env.benchmark.cases import CASES
from icub_jump_env.benchmark.results import Result
from icub_jump_env.checks import check_count
from icub_jump_env.errors import InvalidValueError, printable
from icub_jump_env.evaluation.cli import guarded
from icub_jump_env.evaluation.entry import EntryOptions, parse_entry
from icub_jump_env.evaluation.quantities import CM, PERCENT
from icub_jump_env.evaluation.report.output import check_writable, new_table, say, show
from icub_jump_env.versions import env_of


@dataclass(frozen=True, kw_only=True)
class BenchOptions(EntryOptions):
    """Jump the benchmark: ten cases of 100 episodes; an interrupted run goes on.

    ``icub-jump bench --table FILE ...`` prints a table of results instead.

    Attributes:
        file: The result, a JSON file.
        name: What tables call it; by default environment, controller and policy.
        jobs: Processes that work in parallel.
    """

    file: tyro.conf.Positional[Path]
    name: str | None = None
    jobs: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count("jobs", self.jobs, 1, unit="processes")


def bench(arguments: Sequence[str]) -> None:
    """Run ``icub-jump bench`` with these arguments."""
    guarded(lambda: _bench(arguments))


def _bench(arguments: Sequence[str]) -> None:
    console, progress = Console(), Console(stderr=True)
    if arguments[:1] == ["--table"]:
        if len(arguments) == 1:
            raise InvalidValueError("table", None, "files of results")
        results = [Result.read(Path(word)) for word in arguments[1:]]
        for table in leaderboard(results):
            show(console, table)
        return
    options = parse_entry(BenchOptions, arguments, file=tyro.MISSING)
    from icub_jump_env.benchmark.run import jump

    check_writable("file", options.file)
    contender = options.contender()
    env = options.env if options.policy is None else env_of(options.config)
    name = options.name or f"{env}, {options.config.controller_name}, {contender.name}"
    result = jump(options.config, name, contender, options.jobs, progress)
    result.write(options.file)
    show(console, details(result))
    say(progress, f"wrote {options.file}")


def details(result: Result) -> Table:
    """A row for each case."""
    table = new_table(
        2, "case", "", "success, %", "95 %", "rise, cm", "above standing, cm", "failed",
        title=f"Jump benchmark: {_literal(result.entry)}",
    )  # fmt: skip
    for name, score in result.scores.items():
        failed = ", ".join(f"{n} {_literal(kind)}" for kind, n in score.failures.items())
        table.add_row(
            name, CASES[name].meaning, f"{PERCENT * score.success.share:.0f}", score.success.bounds,
            _cm(score.rise), _cm(score.above_standing), failed,
        )  # fmt: skip
    table.add_section()
    table.add_row("all", "mean of the cases", *_total(result))
    return table


def leaderboard(results: Sequence[Result]) -> tuple[Table, Table]:
    """Success and heights, a row for each result, the best first."""
    success = new_table(1, "entry", "all, %", "95 %", *CASES, title="Jump benchmark: success, %")
    heights = new_table(
        1, "entry", *CASES, title="Mean rise of the CoM above take-off / above standing, cm"
    )
    for result in sorted(results, key=lambda result: -result.total[0]):
        entry, scores = _literal(result.entry), result.scores.values()
        shares = (f"{PERCENT * score.success.share:.0f}" for score in scores)
        success.add_row(entry, *_total(result), *shares)
        rises = (f"{_cm(score.rise)} / {_cm(score.above_standing)}" for score in scores)
        heights.add_row(entry, *rises)
    return success, heights


def _total(result: Result) -> tuple[str, str]:
    mean, (low, high) = result.total
    return f"{PERCENT * mean:.1f}", f"{PERCENT * low:.1f} to {PERCENT * high:.1f}"


def _literal(text: str) -> str:
    """What others wrote, neither obeyed by the terminal nor taken for markup."""
    return escape(printable(text))


def _cm(height: float) -> str:
    return "-" if math.isnan(height) else f"{CM * height:z.2f}"
