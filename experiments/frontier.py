"""The strongest baselines against the shipped policies: how high, and how often they succeed.

    python -m experiments.frontier --controller velocity --jobs 2

The baseline jumps with every command and displacement of a grid, the policy and the constant
shift with the same commands; posture and gains are as they were tuned for the package. The
baselines that come nearest to the policy are chosen there; they and the constant shift then meet
it on episodes that chose nothing. All are judged alike, whatever their command: success is a
landing after a rise that is enough for the policy's command. An interrupted run goes on where it
stopped.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from experiments.figures import frontier_figure
from experiments.seeds import TEST, TUNING
from experiments.shipped import judged_config
from icub_jump_env.checks import check_count
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender, read_contenders
from icub_jump_env.evaluation.episodes.failures import failure_of
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.evaluation.quantities import CM, commands, number, seeds
from icub_jump_env.evaluation.report.output import (
    check_writable,
    new_table,
    say,
    show,
    write_figures,
)
from icub_jump_env.evaluation.statistics.difference import Difference
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.policy.saving import SHIPPED

Episodes = Sequence[Episode]

COMMANDS = (0.05, 0.06, 0.07, 0.08)
DISPLACEMENTS = (0.07, 0.08, 0.09, 0.10, 0.11)

POLICY_COMMAND = 0.06
"""The policy's where it meets the chosen baselines; what is enough for it is a success."""

_GRID_SEEDS = TUNING[:100]
_SUCCESS_SLACK, _RISE_SLACK = 0.02, 0.001
"""By which a baseline may be behind the policy (1, m) on the grid, where episodes are few."""


@dataclass(frozen=True)
class FrontierOptions:
    """Find the strongest baselines.

    Attributes:
        controller: Controller of the launching phase.
        jobs: Processes that work in parallel.
        plot: Draw the picture into this folder.
    """

    controller: ControllerName = "velocity"
    jobs: int = 1
    plot: Path | None = None

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")


@dataclass(frozen=True)
class Point:
    """A contender with one command and displacement.

    Attributes:
        contender: What acts.
        jump_height: Commanded height (m).
        displacement: Rise of the CoM in the launching phase (m).
        summary: What its episodes of the grid say.
    """

    contender: Contender
    jump_height: float
    displacement: float
    summary: Summary

    def __str__(self) -> str:
        height, displacement = (commands(x, x) for x in (self.jump_height, self.displacement))
        return f"{height} after {displacement}"


def run_frontier(options: FrontierOptions) -> None:
    """Run the grid, choose, and let the chosen ones meet the policy."""
    console, progress = Console(), Console(stderr=True)
    if options.plot is not None:
        check_writable("plot", options.plot, folder=True)
    names = (f"{options.controller}.safetensors", f"{options.controller}-constant.safetensors")
    policy, constant = read_contenders([str(SHIPPED / name) for name in names])
    config = judged_config(policy)
    own = config.com_displacement
    assert own is not None  # the task has one
    cells = [(BASELINE, displacement) for displacement in DISPLACEMENTS]
    cells += [(constant, own), (policy, own)]

    def jumps(contender: Contender, command: float, displacement: float, used: range) -> Episodes:
        jump = dataclasses.replace(config, jump_height=command, com_displacement=displacement)
        episodes = Series(jump, used, contender).complete(options.jobs, progress)
        return [judged(episode) for episode in episodes]

    points = [
        Point(contender, command, displacement, Summary.of(episodes))
        for command in COMMANDS
        for contender, displacement in cells
        for episodes in [jumps(contender, command, displacement, _GRID_SEEDS)]
    ]
    if options.plot is not None:
        figures = {"frontier.png": partial(frontier_figure, points)}
        write_figures(options.plot, figures, progress)
    show(console, render(points))
    ours, shifted = (
        next(p for p in points if p.contender is contender and p.jump_height == POLICY_COMMAND)
        for contender in (policy, constant)
    )

    def meet(point: Point) -> Episodes:
        return jumps(point.contender, point.jump_height, point.displacement, TEST)

    learned, fixed = meet(ours), meet(shifted)
    say(console, seeds(TEST))
    say(console, f"policy, {ours}: {_words(learned)}")
    say(console, f"constant shift, {shifted}: {_words(fixed)}")
    say(console, f"  policy against it: {Difference.of(learned, fixed)}")
    for role, rival in strongest([p for p in points if p.contender is BASELINE], ours).items():
        theirs = meet(rival)
        say(console, f"{role}, {rival}: {_words(theirs)}")
        say(console, f"  policy against it: {Difference.of(learned, theirs)}")
        say(console, f"  constant shift against it: {Difference.of(fixed, theirs)}")


def judged(episode: Episode) -> Episode:
    """The same episode, a success if it would be one after the policy's command."""
    failure = failure_of(episode.outcome, episode.jump, POLICY_COMMAND, SuccessConfig())
    return dataclasses.replace(episode, jump_height=POLICY_COMMAND, is_success=failure is None)


def strongest(baselines: Sequence[Point], policy: Point) -> dict[str, Point]:
    """The baselines that come nearest to a policy, by what they are good at.

    The highest of those that succeed as often, and the most successful of those that rise as
    high; where there is none, the most successful, and the highest, of all.
    """

    def success(point: Point) -> tuple[float, float]:
        return point.summary.success.share, point.summary.mean_rise

    def rise(point: Point) -> tuple[float, float]:
        return success(point)[::-1]

    sure = [p for p in baselines if success(p)[0] >= success(policy)[0] - _SUCCESS_SLACK]
    high = [p for p in baselines if rise(p)[0] >= rise(policy)[0] - _RISE_SLACK]
    return {
        "as successful a baseline" if sure else "most successful baseline": (
            max(sure, key=rise) if sure else max(baselines, key=success)
        ),
        "as high a baseline" if high else "highest baseline": (
            max(high, key=success) if high else max(baselines, key=rise)
        ),
    }


def render(points: Sequence[Point]) -> Table:
    """The table of the grid."""
    names, numbers = ("command, cm", "policy", "displacement, cm"), ("landed, %", "success, %")
    table = new_table(len(names), *names, *numbers, "rise, cm", "soles, cm")
    for point, following in zip(points, [*points[1:], None], strict=True):
        summary = point.summary
        table.add_row(
            f"{CM * point.jump_height:g}",
            point.contender.name,
            f"{CM * point.displacement:g}",
            number(summary.landed.share, "%"),
            number(summary.success.share, "%"),
            number(summary.mean_rise, "cm"),
            number(summary.mean_sole_height, "cm"),
            end_section=following is None or following.jump_height != point.jump_height,
        )
    table.caption = (
        f"{seeds(_GRID_SEEDS)}; success: landed after at least "
        f"{CM * SuccessConfig().height_ratio * POLICY_COMMAND:g} cm"
    )
    return table


def _words(episodes: Episodes) -> str:
    summary = Summary.of(episodes)
    return (
        f"success {summary.success}, rise {number(summary.mean_rise, 'cm')} cm, "
        f"soles {number(summary.mean_sole_height, 'cm')} cm"
    )


if __name__ == "__main__":
    guarded(lambda: run_frontier(parse(FrontierOptions, sys.argv[1:])))
