"""Heat maps of the sweep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.figures.style import Figure, panels
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, DEG

if TYPE_CHECKING:
    from icub_jump_env.evaluation.modes.sweep import Cell


def sweep_figure(episodes: Mapping[Cell, Episode]) -> Figure:
    """Heat maps of reached height, rotation and landing."""
    # Controller, desired height and displacement, in the order in which they were run.
    _, heights, displacements = (
        list(dict.fromkeys(cells)) for cells in zip(*episodes, strict=True)
    )
    figure, axes = panels((10.0, 11.0), 3, len(CONTROLLERS), sharex=True, sharey=True)
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
                    [scale * episodes[controller, h, d].jump[metric] for d in displacements]
                    for h in heights
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
            axis.set_xticks(range(len(displacements)), [f"{CM * d:.0f}" for d in displacements])
            axis.set_yticks(range(len(heights)), [f"{CM * h:.0f}" for h in heights])
            axis.set_title(f"{label}, {controller} controller", fontsize=10)
        if metric != "landed":
            figure.colorbar(image, ax=axes[row])
    for axis in axes[-1]:
        axis.set_xlabel("CoM displacement in the launch (cm)")
    for axis in axes[:, 0]:
        axis.set_ylabel("desired height (cm)")
    return figure
