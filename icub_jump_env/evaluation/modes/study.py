"""Studies: the jump in several cases, for both controllers.

Where nothing is random the jump is repeated with link masses that differ by 0.1 %: how much
the result moves then says what a single episode is worth.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import perturbed, varies
from icub_jump_env.evaluation.figures.study import realism_figure
from icub_jump_env.evaluation.modes import cases
from icub_jump_env.evaluation.modes.cases import Case
from icub_jump_env.evaluation.options import STUDY_EPISODES, EvalOptions
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, commands, number, spread
from icub_jump_env.evaluation.report.output import new_table, say, show, write_results
from icub_jump_env.evaluation.statistics.paper import PAPER
from icub_jump_env.evaluation.statistics.summary import Rate, Summary


@dataclass(frozen=True)
class Study:
    """A question, and the cases that answer it.

    Attributes:
        title: Title of the table.
        cases: Makes the cases.
        columns: What is shown of each controller: heading and cell.
        beside_paper: Whether the paper's numbers stand above.
    """

    title: str
    cases: Callable[[], list[Case]]
    columns: dict[str, Callable[[Summary], str]]
    beside_paper: bool = False


def _median(metric: str, unit: str) -> Callable[[Summary], str]:
    return lambda summary: number(summary.median(metric), unit)


def _rise_spread(summary: Summary) -> str:
    low, _, high = summary.percentiles["flight_height"]
    return spread(low, high, "cm")


def share(rate: Rate) -> str:
    """A share, with its interval unless it is the whole."""
    whole = number(rate.share, "%")
    if rate.count == rate.total:
        return whole
    low, high = (number(bound, "%") for bound in rate.interval)
    return f"{whole} ({low}-{high})"


_RISE = {"rise": _median("flight_height", "cm"), "10 to 90 %": _rise_spread}
_ROTATION = {"rot.": _median("flight_rotation", "deg")}
_LANDED = {"landed": lambda summary: share(summary.landed)}
_MEDIANS = {
    "rise": "rise of the CoM in cm",
    "soles": "rise of the soles in cm",
    "rot.": "rotation in flight in deg",
    "unsolved": "control ticks without a solution",
}
"""What headings mean, below the table."""

STUDIES = {
    "realism": Study("Realism study", cases.realism, _RISE | _ROTATION | _LANDED),
    "constraints": Study(
        "Task and momentum as costs (soft) or constraints (hard)",
        cases.constraints,
        _RISE
        | {"success": lambda summary: share(summary.success)}
        | {"unsolved": _median("solver_failures", "steps")},
    ),
    "launch_end": Study("What ends the launch", cases.launch_end, _RISE | _ROTATION | _LANDED),
    "robots": Study(
        "The iCubs of icub-models",
        cases.robots,
        _RISE | {"soles": _median("sole_height", "cm")} | _LANDED,
        beside_paper=True,
    ),
}
"""Studies by name."""


@dataclass(frozen=True)
class CaseResult:
    """Outcome of a case by controller."""

    case: Case
    summaries: dict[ControllerName, Summary]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        summaries = {name: summary.as_dict() for name, summary in self.summaries.items()}
        return dataclasses.asdict(self.case) | summaries


def run(options: EvalOptions, _: Sequence[Contender], console: Console, progress: Console) -> None:
    """Run ``eval.py --study``."""
    assert options.study is not None  # else it were another mode
    study = STUDIES[options.study]
    results = run_cases(study, options, progress)
    found = {"cases": [result.as_dict() for result in results]}
    figures = {}
    if options.study == "realism":
        figures = {"realism.png": partial(realism_figure, results)}
    write_results(options, progress, found, figures)
    show(console, render(study, results, options))
    for line in short_flights(results, options.config.success.flight_time):
        say(console, line)
    if figures and options.plot is None:
        say(progress, "for the picture add --plot FOLDER")


def run_cases(study: Study, options: EvalOptions, progress: Console) -> list[CaseResult]:
    """Run every case with both controllers."""
    all_cases = study.cases()
    for name in {name for case in all_cases for name in case.changes}:
        value = options.config.value_of(name)
        if value != JumpConfig().value_of(name):
            raise ConfigError(name, value, f"not with --study {options.study}, which varies it")
    count = options.episodes or STUDY_EPISODES
    work, owners = [], []
    for index, case in enumerate(all_cases):
        for controller in CONTROLLERS:
            config = options.config.for_controller(controller).replace(**case.changes)
            if not varies(config):
                config = perturbed(config)
            for seed in range(options.seed, options.seed + count):
                work.append(Job(config, seed))
                owners.append((index, controller))
    episodes: dict[tuple[int, ControllerName], list[Episode]] = {o: [] for o in owners}
    for owner, episode in zip(owners, run_all(work, options.workers, progress), strict=True):
        episodes[owner].append(episode)
    return [
        CaseResult(case, {c: Summary.of(episodes[index, c]) for c in CONTROLLERS})
        for index, case in enumerate(all_cases)
    ]


def render(study: Study, results: Sequence[CaseResult], options: EvalOptions) -> Table:
    """The table for the terminal."""
    headings = [f"{c[:3]}.\n{heading}" for c in CONTROLLERS for heading in study.columns]
    title = study.title
    if study is not STUDIES["constraints"]:
        title = f"{title}, {commands(*options.config.jump_heights)} jump"
    table = new_table(1, "", *headings, title=title)
    if study.beside_paper:
        shown = {"rise": "flight_height", "soles": "sole_height"}
        cells = [
            f"{CM * PAPER[c][shown[heading]]:g}" if heading in shown else ""
            for c in CONTROLLERS
            for heading in study.columns
        ]
        table.add_row("the paper's simulation", *cells, end_section=True)
    group = ""
    for result in results:
        if result.case.group != group:
            group = result.case.group
            table.add_section()
            table.add_row(f"[bold]{group}[/bold]")
        cells = [cell(result.summaries[c]) for c in CONTROLLERS for cell in study.columns.values()]
        table.add_row(f"{'  ' if group else ''}{result.case.label}", *cells)
    medians = [meaning for heading, meaning in _MEDIANS.items() if heading in study.columns]
    shares = [heading for heading in ("landed", "success") if heading in study.columns]
    table.caption = (
        f"vel., tor.: velocity and torque controller; {', '.join(medians)}: medians of "
        f"{options.episodes or STUDY_EPISODES} episodes; {', '.join(shares)}: share in % (95 % interval). "
        "Where nothing else is random, link masses vary by 0.1 %"
    )
    return table


def short_flights(results: Sequence[CaseResult], flight_time: float) -> list[str]:
    """A line for each case with flights, if any, that were shorter than ``flight_time`` (s)."""
    lines = []
    for result in results:
        for controller, summary in result.summaries.items():
            stayed = len(summary.failures.get(Failure.NO_TAKEOFF, ()))
            if stayed:
                total = summary.landed.total
                lines.append(
                    f"{controller}, {result.case.label}: "
                    f"no flight of {flight_time:g} s in {stayed} of {total}"
                )
    return lines
