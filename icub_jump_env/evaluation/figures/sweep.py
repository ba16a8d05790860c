"""Heat maps of the sweep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.figures.style import Figure, panels
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, SCALE

if TYPE_CHECKING:
    from icub_jump_env.evaluation.modes.sweep import Cell


def sweep_figure(episodes: Mapping[Cell, Episode]) -> Figure:
    """Heat maps of reached height and rotation; in brackets where the robot fell."""
    # Controller, desired height and displacement, in the order in which they were run.
    _, heights, displacements = (
        list(dict.fromkeys(cells)) for cells in zip(*episodes, strict=True)
    )
    figure, axes = panels((10.0, 7.4), 2, len(CONTROLLERS), sharex=True, sharey=True)
    shown = (
        ("flight_height", "cm", "CoM rise", "viridis", (0.0, 8.0)),
        ("flight_rotation", "deg", "rotation in flight", "coolwarm", (-8.0, 8.0)),
    )
    for row, (metric, unit, label, colors, (low, high)) in enumerate(shown):
        for column, controller in enumerate(CONTROLLERS):
            axis = axes[row, column]
            cells = [[episodes[controller, h, d].jump for d in displacements] for h in heights]
            values = np.array([[SCALE[unit] * jump[metric] for jump in jumps] for jumps in cells])
            image = axis.imshow(
                values, cmap=colors, vmin=low, vmax=high, origin="lower", aspect="auto"
            )
            for (i, j), value in np.ndenumerate(values):
                text = f"{value:z.1f}"
                axis.text(
                    j, i, text if cells[i][j]["landed"] else f"({text})",
                    ha="center", va="center", fontsize=9,
                    color="white" if unit == "cm" and value < 5.0 else "black",
                )  # fmt: skip
            axis.set_xticks(range(len(displacements)), [f"{CM * d:.0f}" for d in displacements])
            axis.set_yticks(range(len(heights)), [f"{CM * h:.0f}" for h in heights])
            axis.set_title(f"{label} ({unit}), {controller} controller", fontsize=10)
        figure.colorbar(image, ax=axes[row])
    for axis in axes[-1]:
        axis.set_xlabel("CoM displacement in the launch (cm)")
    for axis in axes[:, 0]:
        axis.set_ylabel("desired height (cm)")
    everywhere = all(episode.jump["landed"] for episode in episodes.values())
    figure.suptitle("lands in every cell" if everywhere else "in brackets: fell", fontsize=10)
    return figure
