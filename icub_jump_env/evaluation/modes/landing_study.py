"""The landing study: how often the robot stands, by size of what disturbs it.

Every variant jumps the same seeds, so that each is compared with the paper's pair by pair.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.episodes.cluster import Jobs
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series, fill
from icub_jump_env.evaluation.modes.landing_cases import (
    FEEDBACK,
    FLIGHT_TIME,
    HIGHEST,
    HOLD,
    VARIANTS,
    LandingCase,
    disturbances_of,
    landing_cases,
)
from icub_jump_env.evaluation.modes.study import share
from icub_jump_env.evaluation.options import STUDY_EPISODES, EvalOptions
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, number, seeds
from icub_jump_env.evaluation.report.output import new_table, say, show, write_results
from icub_jump_env.evaluation.statistics.difference import RateDifference, holm_corrected
from icub_jump_env.evaluation.statistics.summary import Summary

if TYPE_CHECKING:
    from icub_jump_env.evaluation.figures.style import Figure

MARKS = {-1: " <", 0: "  ", 1: " >"}
"""Marks of a rate in the table by the sign of its difference to the paper's."""


@dataclass(frozen=True)
class LandingResult:
    """Outcome of a case.

    Attributes:
        case: The case.
        summaries: What the episodes of each variant say.
        against_hold: The standing rate of each other variant against the paper's.
    """

    case: LandingCase
    summaries: Mapping[str, Summary]
    against_hold: Mapping[str, RateDifference]

    @classmethod
    def of(cls, case: LandingCase, episodes: Mapping[str, Sequence[Episode]]) -> LandingResult:
        """The outcome of the episodes of each variant, which have the same seeds."""
        return cls(
            case,
            {variant: Summary.of(found) for variant, found in episodes.items()},
            {
                variant: RateDifference.of(found, episodes[HOLD], _landed)
                for variant, found in episodes.items()
                if variant != HOLD
            },
        )

    def sign(self, variant: str) -> int:
        """1 or -1 if a variant stands significantly more or less often than the paper's."""
        return self.against_hold[variant].sign if variant != HOLD else 0

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        variants = {
            variant: summary.as_dict()
            | {
                "against_hold": dataclasses.asdict(self.against_hold[variant])
                if variant in self.against_hold
                else None
            }
            for variant, summary in self.summaries.items()
        }
        return dataclasses.asdict(self.case) | {"variants": variants}


Results = dict[ControllerName, list[LandingResult]]
"""Results of all cases by controller."""


def _landed(episode: Episode) -> bool:
    return episode.landed


def run(options: EvalOptions, _: Sequence[Contender], console: Console, progress: Console) -> None:
    """Run ``eval.py --study landing``."""
    results = run_cases(options, progress)
    found = {
        "episodes": len(used_seeds(options)),
        "variants": {variant: dict(changes) for variant, changes in VARIANTS.items()},
        "units": {found.name: found.scale for found in disturbances_of(options.config)},
        "cases": {
            controller: [result.as_dict() for result in done]
            for controller, done in results.items()
        },
    }

    def figure() -> Figure:
        from icub_jump_env.evaluation.figures.landing import landing_figure

        return landing_figure(results, disturbances_of(options.config))

    write_results(options, progress, found, {"landing.png": figure})
    for controller in CONTROLLERS:
        show(console, render(controller, results, options))
    if options.plot is None:
        say(progress, "for the picture add --plot FOLDER")


def used_seeds(options: EvalOptions) -> range:
    """Seeds of each case."""
    return range(options.seed, options.seed + (options.episodes or STUDY_EPISODES))


def run_cases(options: EvalOptions, progress: Console) -> Results:
    """Run every case with both controllers and each variant."""
    used = dict.fromkeys(CONTROLLERS, used_seeds(options))
    jumps = {name: options.config.for_controller(name) for name in CONTROLLERS}
    cases = {name: landing_cases(config) for name, config in jumps.items()}
    return compare(jumps, cases, list(VARIANTS), used, options.workers, options.resume, progress)


def compare(
    jumps: Mapping[ControllerName, JumpConfig],
    cases: Mapping[ControllerName, Sequence[LandingCase]],
    variants: Sequence[str],
    used: Mapping[ControllerName, range],
    jobs: Jobs,
    resume: bool,
    progress: Console,
) -> Results:
    """Run cases with some variants, each on the same seeds.

    Args:
        jumps: The configuration of each controller, which the cases change.
        cases: The cases of each controller.
        variants: Names among :data:`VARIANTS`, the paper's among them.
        used: The seeds of each controller.
        jobs: Number of worker processes, or a cluster.
        resume: Whether to go on with existing logs.
        progress: Where the progress is shown.
    """
    series = [
        Series(config.replace(**case.changes, **VARIANTS[variant]), used[name])
        for name, config in jumps.items()
        for case in cases[name]
        for variant in variants
    ]
    logs = [each.open_log(each.default_log(), resume) for each in series]
    done = iter(fill(list(zip(series, logs, strict=True)), jobs, progress))
    results = {
        name: [
            LandingResult.of(case, {variant: next(done) for variant in variants})
            for case in cases[name]
        ]
        for name in jumps
    }
    return _corrected(results)


def _corrected(results: Results) -> Results:
    """The same with p-values that are corrected for the number of all comparisons."""
    found = [d for done in results.values() for r in done for d in r.against_hold.values()]
    corrected = iter(holm_corrected(found))
    return {
        name: [
            dataclasses.replace(
                result, against_hold={variant: next(corrected) for variant in result.against_hold}
            )
            for result in done
        ]
        for name, done in results.items()
    }


def render(controller: ControllerName, results: Results, options: EvalOptions) -> Table:
    """The table of a controller for the terminal."""
    table = new_table(
        1, "", *(f"{variant}  " for variant in VARIANTS), f"force, N\n{HOLD}", f"\n{FEEDBACK}",
        title=f"Standing rate, {controller} controller, {seeds(used_seeds(options))}",
    )  # fmt: skip
    units = {found.name: found.scale for found in disturbances_of(options.config)}
    group = None
    for result in results[controller]:
        if result.case.group != group:
            group = result.case.group
            table.add_section()
            heading = f"{group}, {units[group]}" if group else "without disturbance"
            table.add_row(f"[bold]{heading}[/bold]")
        rates = [
            share(summary.landed) + MARKS[result.sign(variant)]
            for variant, summary in result.summaries.items()
        ]
        forces = [
            number(result.summaries[variant].median("landing_force"), "N")
            for variant in (HOLD, FEEDBACK)
        ]
        table.add_row(f"  {result.case.label}", *rates, *forces)
    compared = sum(len(result.against_hold) for done in results.values() for result in done)
    table.caption = (
        "share that landed and stands in % (95 % interval); force: median of the largest ground "
        "force after touch-down\n"
        f"< less, > more often than {HOLD}: the 95 % interval of the paired difference leaves out "
        f"zero, as about one in 20 of the {compared} comparisons of both controllers does by "
        "chance; --json has p-values corrected for their number\n"
        "disturbances: of jumps of 4 cm, full, whose first row is size zero; rotation: spin times "
        f"{FLIGHT_TIME:g} s; pushes in m/s: impulse divided by the nominal mass of the robot; "
        f"highest plan: {CM * HIGHEST[controller]:g} cm"
    )
    return table
