"""Desired height against displacement: where the jump works, for both controllers."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.table import Table

from icub_jump_env.config import ControllerName
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.report.output import save_figure, say, show, write_json
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.report.provenance import command, provenance
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.modes.study import CONTROLLERS
from icub_jump_env.evaluation.quantities import CM, DEG

HEIGHTS = tuple(0.01 * cm for cm in range(2, 9))
"""Desired heights (m)."""

DISPLACEMENTS = tuple(0.01 * cm for cm in range(8, 15))
"""Displacements of the CoM in the launching phase (m)."""

Cell = tuple[ControllerName, float, float]
"""Controller, desired height (m), displacement (m)."""


def run_sweep(options: EvalOptions, console: Console, progress: Console) -> None:
    """Run ``eval.py --sweep``."""
    cells: list[Cell] = [
        (controller, height, displacement)
        for controller in CONTROLLERS
        for height in HEIGHTS
        for displacement in DISPLACEMENTS
    ]
    work = [
        Job(
            dataclasses.replace(
                options.config,
                controller=controller,
                jump_height=height,
                com_displacement=displacement,
            ),
            options.seed,
        )
        for controller, height, displacement in cells
    ]
    episodes = dict(zip(cells, run_all(work, options.jobs, progress), strict=True))
    wrote = []
    if options.json is not None:
        write_json(options.json, sweep_report(episodes, options))
        wrote.append(options.json)
    if options.plot is not None:
        file = save_figure(options.plot, "sweep.png", sweep_figure(episodes))
        wrote.append(file)
    for controller in CONTROLLERS:
        show(console, render(episodes, controller))
    for path in wrote:
        say(console, f"wrote {path}")
    if options.plot is None:
        say(progress, "for the heat maps add --plot FOLDER")


def render(episodes: Mapping[Cell, Episode], controller: ControllerName) -> Table:
    """Reached heights in cm; brackets where the robot did not stay on its feet."""
    table = Table(
        title=f"CoM rise (cm), {controller} controller; in brackets: fell",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column("displacement (cm)\ndesired height", no_wrap=True)
    for displacement in DISPLACEMENTS:
        table.add_column(f"\n{CM * displacement:.0f}", justify="right", no_wrap=True)
    for height in HEIGHTS:
        cells = []
        for displacement in DISPLACEMENTS:
            jump = episodes[controller, height, displacement].jump
            rise = f"{CM * jump['flight_height']:.2f}"
            cells.append(rise if jump["landed"] else f"({rise})")
        table.add_row(f"{CM * height:.0f}", *cells)
    return table


def sweep_figure(episodes: Mapping[Cell, Episode]) -> Figure:
    """Heat maps of reached height, rotation and landing."""
    figure = Figure(figsize=(10.0, 11.0), dpi=110, layout="constrained")
    axes = figure.subplots(3, len(CONTROLLERS), sharex=True, sharey=True)
    shown = (
        ("flight_height", CM, "CoM rise (cm)", "viridis", (0.0, 8.0)),
        ("flight_rotation", DEG, "rotation in flight (deg)", "coolwarm", (-8.0, 8.0)),
        ("landed", 1.0, "landed (1) or not (0)", "RdYlGn", (-0.5, 1.5)),
    )
    for row, (metric, scale, label, colors, (low, high)) in enumerate(shown):
        for column, controller in enumerate(CONTROLLERS):
            axis = axes[row, column]
            values = np.array(
                [
                    [scale * episodes[controller, h, d].jump[metric] for d in DISPLACEMENTS]
                    for h in HEIGHTS
                ]
            )
            image = axis.imshow(
                values, cmap=colors, vmin=low, vmax=high, origin="lower", aspect="auto"
            )
            dark = metric == "flight_height"
            for (i, j), value in np.ndenumerate(values):
                axis.text(
                    j, i, f"{value:.{0 if metric == 'landed' else 1}f}",
                    ha="center", va="center", fontsize=8,
                    color="white" if dark and value < 5.0 else "black",
                )  # fmt: skip
            axis.set_xticks(range(len(DISPLACEMENTS)), [f"{CM * d:.0f}" for d in DISPLACEMENTS])
            axis.set_yticks(range(len(HEIGHTS)), [f"{CM * h:.0f}" for h in HEIGHTS])
            axis.set_title(f"{label}, {controller} controller", fontsize=10)
        if metric != "landed":
            figure.colorbar(image, ax=axes[row])
    for axis in axes[-1]:
        axis.set_xlabel("CoM displacement in the launch (cm)")
    for axis in axes[:, 0]:
        axis.set_ylabel("desired height (cm)")
    return figure


def sweep_report(episodes: Mapping[Cell, Episode], options: EvalOptions) -> dict[str, Any]:
    """Everything the sweep found, for ``--json``."""
    return {
        "mode": "sweep",
        "command": command(),
        **provenance(options.config, options.seed),
        "cells": [
            {
                "controller": controller,
                "jump_height": height,
                "com_displacement": displacement,
                "outcome": episode.outcome,
                "failure": episode.failure,
                "jump": episode.jump,
            }
            for (controller, height, displacement), episode in episodes.items()
        ],
    }
