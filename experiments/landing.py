"""Does feedback land what the paper's posture cannot, and does it lose nothing?

    python -m experiments.landing --jobs 2

Both controllers jump every row with ``flight="minimum_jerk"``, ``landing="hold"`` and with
feedback, on the same seeds, on which nothing was chosen. The musts and aims were written down
before. An interrupted run goes on where it stopped; ``eval.py --study landing`` draws the curves
between the rows.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from rich.console import Console
from rich.table import Table

from experiments.seeds import LANDING_TEST
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.modes.landing_cases import (
    FEEDBACK,
    HIGHEST,
    HOLD,
    LandingCase,
    landing_cases,
)
from icub_jump_env.evaluation.modes.landing_study import LandingResult, Results, compare
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, number, probability, seeds
from icub_jump_env.evaluation.report.output import new_table, show

Percent = float | None
"""None: to be reported."""

AIMS: Mapping[tuple[str, str], tuple[Percent, Percent]] = MappingProxyType(
    {
        ("", "4 cm, full"): (100, 100),
        ("", "4 cm, hard"): (100, 100),
        ("", "8 cm after 8 cm, full"): (95, 99),
        ("", "6 cm after 8 cm, hard"): (95, 99),
        ("", "highest plan, full"): (95, 99),
        ("", "6 cm plan, hard"): (92, 97),
        ("", "8 cm after 8 cm, full, sensors"): (90, 95),
        ("", "5 times 6 cm, full"): (90, 97),
        ("rotation at lift-off", "-10"): (95, 98),
        ("rotation at lift-off", "+7"): (75, 95),
        ("floor tilt fore-aft", "-4"): (85, 95),
        ("floor tilt fore-aft", "+5"): (95, 98),
        ("floor tilt sideways", "4"): (None, 90),
        ("step under the left foot", "2"): (None, 90),
        ("edge under the left foot", "+2"): (85, 95),
        ("push in flight", "-0.2"): (90, 95),
        ("push after landing", "-0.3"): (None, 80),
        ("push after landing", "+0.3"): (70, 80),
        ("side push after landing", "0.4"): (None, None),
        ("push in the launch", "-6"): (None, None),
        ("push in the launch", "+6"): (None, None),
    }
)
"""Must and aim of the standing rate (%) by group and label of the case."""

SERIES = LandingCase(
    "",
    "5 times 6 cm, full",
    {"jumps": 5, "jump_height": 0.06, "com_displacement": 0.08, "randomization": "full"},
)
"""Five jumps in a row; all of them must land."""


@dataclass(frozen=True)
class LandingOptions:
    """Judge flight and landing by feedback.

    Attributes:
        jobs: Processes that work in parallel.
    """

    jobs: int = 1

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")


def run_landing(options: LandingOptions) -> None:
    """Jump every row, and compare."""
    console, progress = Console(), Console(stderr=True)
    results = judged(options.jobs, progress)
    for controller in CONTROLLERS:
        show(console, render(controller, results[controller]))


def judged(jobs: int, progress: Console) -> Results:
    """The rows of both controllers, with and without feedback."""
    jumps = {name: JumpConfig.of(controller=name) for name in CONTROLLERS}
    cases = {name: rows(config) for name, config in jumps.items()}
    return compare(jumps, cases, (HOLD, FEEDBACK), LANDING_TEST, jobs, True, progress)


def rows(config: JumpConfig) -> list[LandingCase]:
    """The judged cases, in the order of the aims."""
    cases = {(case.group, case.label): case for case in [*landing_cases(config), SERIES]}
    return [cases[row] for row in AIMS]


def render(controller: ControllerName, results: Sequence[LandingResult]) -> Table:
    """The table of a controller."""
    table = new_table(
        2, "", "must", "aim", "hold, %", "feedback, %", "95 %", "points", "95 %", "p",
        "force, %", "rise, cm", "limits",
        title=f"Landings, {controller} controller, {seeds(LANDING_TEST[controller])}",
    )  # fmt: skip
    for result in results:
        case, ours = result.case, result.summaries[FEEDBACK]
        theirs, difference = result.summaries[HOLD], result.against_hold[FEEDBACK]
        p = difference.corrected_p_value
        force = ours.median("landing_force") / theirs.median("landing_force") - 1.0
        must, aim = AIMS[case.group, case.label]
        table.add_row(
            f"{case.group} {case.label}".strip(),
            *("-" if bound is None else f"{bound:g}" for bound in (must, aim)),
            number(theirs.landed.share, "%"),
            number(ours.landed.share, "%"),
            ours.landed.bounds,
            f"{100 * difference.gain:+z.1f}",
            "{:+z.1f} to {:+z.1f}".format(*(100 * bound for bound in difference.interval)),
            probability(difference.p_value if p is None else p),
            f"{100 * force:+z.0f}",
            number(ours.mean_rise, "cm"),
            number(ours.median("limit_violations"), "steps"),
        )
    table.caption = (
        "hold, feedback: share that landed and stands, with the interval of feedback; points: "
        "their difference, pairs of the same seed; p: McNemar, Holm-corrected over both "
        "controllers; force: median of the largest ground force after touch-down against hold; "
        "rise: mean of feedback; limits: median of its physics steps with a joint beyond a limit; "
        f"highest plan: {CM * HIGHEST[controller]:g} cm; units as in eval.py --study landing"
    )
    return table


if __name__ == "__main__":
    guarded(lambda: run_landing(parse(LandingOptions, sys.argv[1:])))
