"""The strongest baselines against the shipped policies: how high, and how often they succeed.

    python -m experiments.frontier --controller velocity --jobs 2

The baseline jumps with every command and displacement of a grid, the policy and the constant
shift with the same commands; posture and gains are as they were tuned for the package. The
strongest baselines are chosen there by every rule of :func:`rivals`; they, the constant shift and
the policy then meet once, on held-out seeds. All are judged alike, whatever their command: success
is a landing after a rise that is enough for the policy's command. An interrupted run goes on where
it stopped.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Sequence
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
from icub_jump_env.evaluation.statistics.difference import (
    Difference,
    holm_corrected,
    in_words,
)
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.policy.saving import SHIPPED

Episodes = Sequence[Episode]

COMMANDS = (0.05, 0.06, 0.07, 0.08)
DISPLACEMENTS = (0.07, 0.08, 0.09, 0.10, 0.11)

POLICY_COMMAND = 0.06
"""The policy's where it meets the chosen baselines; what is enough for it is a success."""

SLACKS = {"success": (0.02, "2 points"), "rise": (0.001, "1 mm")}
"""By which a matched baseline may be behind the policy (1, m) on the grid, where episodes are few.

The slack on the rise came after a result without it had been seen, so both rules are shown.
"""

_GRID_SEEDS = TUNING[:100]


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
    """Run the grid, choose by every rule, and let the chosen ones meet the policy once."""
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
    ours, shifted = (
        next(p for p in points if p.contender is contender and p.jump_height == POLICY_COMMAND)
        for contender in (policy, constant)
    )
    by_rule = rivals([p for p in points if p.contender is BASELINE], ours)
    chosen = {f"baseline, {rival}": rival for rival in by_rule.values()}
    if options.plot is not None:
        figures = {"frontier.png": partial(frontier_figure, points, list(chosen.values()))}
        write_figures(options.plot, figures, progress)
    show(console, render(points))
    say(console, f"held-out {seeds(TEST)}")

    def meet(point: Point, role: str) -> Episodes:
        episodes = jumps(point.contender, point.jump_height, point.displacement, TEST)
        say(console, f"{role}: {_words(episodes)}")
        return episodes

    learned = meet(ours, f"policy, {ours}")
    fixed = meet(shifted, f"constant shift, {shifted}")
    differences = {"policy against constant shift": Difference.of(learned, fixed)}
    for name, rival in chosen.items():
        rules = "; ".join(rule for rule, point in by_rule.items() if point is rival)
        theirs = meet(rival, f"{name} ({rules})")
        differences[f"policy against {name}"] = Difference.of(learned, theirs)
        differences[f"constant shift against {name}"] = Difference.of(fixed, theirs)
    corrected = holm_corrected(list(differences.values()))
    for line in in_words(dict(zip(differences, corrected, strict=True))):
        say(console, line)


def judged(episode: Episode) -> Episode:
    """The same episode, a success if it would be one after the policy's command."""
    failure = failure_of(episode.outcome, episode.jump, POLICY_COMMAND, SuccessConfig())
    return dataclasses.replace(episode, jump_height=POLICY_COMMAND, is_success=failure is None)


def rivals(baselines: Sequence[Point], policy: Point) -> dict[str, Point]:
    """The strongest baselines against a policy, by the rule that chooses each.

    Matched on success: the highest of those that succeed at least as often. Matched on rise: the
    most successful of those that rise at least as high. Each without a slack and with that of
    :data:`SLACKS`. Where none is matched: the most successful, or the highest, of all.
    """
    values: dict[str, Callable[[Point], float]] = {
        "success": lambda point: point.summary.success.share,
        "rise": lambda point: point.summary.mean_rise,
    }
    found = {}
    for measure, other, best in (
        ("success", "rise", "most successful"),
        ("rise", "success", "highest"),
    ):
        match, rank = values[measure], values[other]
        for slack, within in ((0.0, ""), (SLACKS[measure][0], f" within {SLACKS[measure][1]}")):
            rule = f"matched on {measure}{within}"
            matched = [p for p in baselines if match(p) >= match(policy) - slack]
            if matched:
                found[rule] = max(matched, key=lambda p: (rank(p), match(p)))
            else:
                found[f"{best}, as none is {rule}"] = max(
                    baselines, key=lambda p: (match(p), rank(p))
                )
    return found


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
