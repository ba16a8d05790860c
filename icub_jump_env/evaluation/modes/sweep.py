"""Desired height against displacement: where the jump works, for both controllers."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from rich.console import Console
from rich.table import Table

from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.figures.sweep import sweep_figure
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, number
from icub_jump_env.evaluation.report.output import new_table, say, show, write_results

HEIGHTS = tuple(0.01 * cm for cm in range(2, 9))
"""Desired heights (m)."""

DISPLACEMENTS = tuple(0.01 * cm for cm in range(8, 15))
"""Displacements of the CoM in the launching phase (m)."""

Cell = tuple[ControllerName, float, float]
"""Controller, desired height (m), displacement (m)."""


def run(options: EvalOptions, _: Sequence[Contender], console: Console, progress: Console) -> None:
    """Run ``eval.py --sweep``."""
    cells: list[Cell] = list(itertools.product(CONTROLLERS, HEIGHTS, DISPLACEMENTS))
    names = ("controller", "jump_height", "com_displacement")
    changes: list[dict[str, Any]] = [dict(zip(names, cell, strict=True)) for cell in cells]
    jumps = {name: options.config.for_controller(name) for name in CONTROLLERS}
    work = [
        Job(
            dataclasses.replace(jumps[controller], jump_height=height, com_displacement=rise),
            options.seed,
        )
        for controller, height, rise in cells
    ]
    done = run_all(work, options.workers, progress)
    found = [
        change | {"outcome": episode.outcome, "failure": episode.failure, "jump": episode.jump}
        for change, episode in zip(changes, done, strict=True)
    ]
    episodes = dict(zip(cells, done, strict=True))
    figures = {"sweep.png": partial(sweep_figure, episodes)}
    write_results(options, progress, {"cells": found}, figures)
    for controller in CONTROLLERS:
        show(console, render(episodes, controller))
    if options.plot is None:
        say(progress, "for the heat maps add --plot FOLDER")


def render(episodes: Mapping[Cell, Episode], controller: ControllerName) -> Table:
    """Reached heights in cm; brackets where the robot did not stay on its feet."""
    title = f"CoM rise (cm), {controller} controller; in brackets: fell"
    headings = (f"\n{CM * displacement:.0f}" for displacement in DISPLACEMENTS)
    table = new_table(1, "displacement (cm)\ndesired height", *headings, title=title)
    for height in HEIGHTS:
        cells = []
        for displacement in DISPLACEMENTS:
            jump = episodes[controller, height, displacement].jump
            rise = number(jump["flight_height"], "cm")
            cells.append(rise if jump["landed"] else f"({rise})")
        table.add_row(f"{CM * height:.0f}", *cells)
    return table
