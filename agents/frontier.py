"""The strongest baselines beside the shipped policies: how high, and how often it lands.

    python -m agents.frontier --controller velocity --jobs 2

The baseline jumps with every command and displacement of a grid, the policy with the same
commands, all on the same episodes. An interrupted run goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.table import Table

from agents.options import TASK
from icub_jump_env.checks import check_count
from icub_jump_env.config import ControllerName
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.contender import BASELINE, Contender, read_contenders
from icub_jump_env.evaluation.output import say, show
from icub_jump_env.evaluation.series import Series
from icub_jump_env.evaluation.summary import Summary
from icub_jump_env.evaluation.table import CM

HEIGHTS = (0.05, 0.06, 0.07, 0.08)
DISPLACEMENTS = (0.08, 0.09, 0.10, 0.11)
TEST_SEEDS = range(3000, 3100)
"""Neither trained on nor chosen by."""


@dataclass(frozen=True)
class FrontierOptions:
    """Find the strongest baselines.

    Attributes:
        controller: Controller of the launching phase.
        jobs: Processes that work in parallel.
        plot: Draw the picture into this file.
    """

    controller: ControllerName = "velocity"
    jobs: int = 1
    plot: Path | None = None

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1)


@dataclass(frozen=True)
class Point:
    """One command and displacement.

    Attributes:
        jump_height: Commanded height (m).
        displacement: Rise of the CoM in the launching phase (m).
        contender: What acted.
        summary: What its episodes say.
    """

    jump_height: float
    displacement: float
    contender: Contender
    summary: Summary


def frontier(options: FrontierOptions) -> None:
    """Run the grid and print the table."""
    console, progress = Console(), Console(stderr=True)
    (policy,) = read_contenders([f"agents/pretrained/{options.controller}.safetensors"])
    assert policy.card is not None  # it was read from a file
    trained = policy.card.config.com_displacement or max(DISPLACEMENTS)
    cells = [(BASELINE, d) for d in DISPLACEMENTS] + [(policy, trained)]
    points = [
        _point(options, height, displacement, contender, progress)
        for height in HEIGHTS
        for contender, displacement in cells
    ]
    if options.plot is not None:
        frontier_figure(points).savefig(options.plot)
        say(progress, f"wrote {options.plot}")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in ("command, cm", "policy", "displacement, cm"):
        table.add_column(column)
    for column in ("landed, %", "success, %", "rise, cm"):
        table.add_column(column, justify="right")
    for point in points:
        last = point is points[-1] or point.contender is policy
        summary = point.summary
        table.add_row(
            f"{CM * point.jump_height:g}",
            point.contender.name,
            f"{CM * point.displacement:g}",
            f"{100 * summary.landed.share:.0f}",
            f"{100 * summary.success.share:.0f}",
            f"{CM * summary.mean_rise:.2f}",
            end_section=last,
        )
    show(console, table)


def _point(
    options: FrontierOptions,
    height: float,
    displacement: float,
    contender: Contender,
    progress: Console,
) -> Point:
    config = dataclasses.replace(
        TASK, controller=options.controller, jump_height=height, com_displacement=displacement
    )
    series = Series(config, TEST_SEEDS, contender)
    episodes = series.complete(options.jobs, progress)
    return Point(height, displacement, contender, Summary.of(episodes))


def frontier_figure(points: Sequence[Point]) -> Figure:
    """Mean rise over the share that lands; labels name command and displacement (cm)."""
    figure = Figure(figsize=(6.5, 4.2), dpi=120, layout="constrained")
    axis = figure.subplots()
    for name, color in (("baseline", "0.45"), ("policy", "tab:blue")):
        shown = [p for p in points if p.contender.is_baseline == (name == "baseline")]
        axis.plot(
            [100 * p.summary.landed.share for p in shown],
            [CM * p.summary.mean_rise for p in shown],
            "o",
            color=color,
            label=name,
        )
        for p in shown:
            axis.annotate(
                f"{CM * p.jump_height:g}/{CM * p.displacement:g}",
                (100 * p.summary.landed.share, CM * p.summary.mean_rise),
                textcoords="offset points",
                xytext=(4, 3),
                fontsize=7,
                color=color,
            )
    axis.set(xlabel="landed (%)", ylabel="mean CoM rise (cm)")
    axis.set_title("command / displacement (cm)", fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False)
    return figure


if __name__ == "__main__":
    guarded(lambda: frontier(parse(FrontierOptions, sys.argv[1:])))
