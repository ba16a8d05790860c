"""The picture of the realism study."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.figures.style import CONTROLLER, Figure, panels
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, DEG

if TYPE_CHECKING:
    from icub_jump_env.evaluation.modes.study import CaseResult

_ROWS = (("flight_height", CM, "CoM rise (cm)"), ("flight_rotation", DEG, "rotation (deg)"))


def realism_figure(results: Sequence[CaseResult]) -> Figure:
    """Rise and rotation of every case; medians with 10th and 90th percentile.

    Args:
        results: The study's results, grouped.

    Returns:
        One column per group; how many landed shows in the markers.
    """
    groups = [(name, list(members)) for name, members in groupby(results, lambda r: r.case.group)]
    figure, axes = panels(
        (16.0, 6.4), len(_ROWS), len(groups), sharex="col", sharey="row",
        width_ratios=[len(members) for _, members in groups],
    )  # fmt: skip
    for column, (name, members) in enumerate(groups):
        for row, (metric, scale, label) in enumerate(_ROWS):
            axis = axes[row, column]
            for offset, controller in zip((-0.12, 0.12), CONTROLLERS, strict=True):
                _points(axis, members, controller, metric, scale, offset)
            axis.grid(axis="y", color="0.9")
            if column == 0:
                axis.set_ylabel(label)
        axes[0, column].set_title(name, fontsize=10)
        axes[-1, column].set_xticks(
            range(len(members)), [r.case.label for r in members], rotation=90, fontsize=8
        )
    figure.legend(handles=_legend(), loc="outside lower center", ncols=5, frameon=False)
    return figure


def _points(
    axis: Axes,
    members: Sequence[CaseResult],
    controller: ControllerName,
    metric: str,
    scale: float,
    offset: float,
) -> None:
    color = CONTROLLER[controller]
    for x, result in enumerate(members):
        summary = result.summaries[controller]
        low, middle, high = scale * np.array(summary.percentiles[metric])
        axis.plot([x + offset] * 2, [low, high], color=color, lw=1.5)
        share = summary.landed.share
        axis.plot(
            x + offset, middle, ls="", color=color, ms=6,
            marker="x" if share == 0.0 else "o",
            markerfacecolor=color if share == 1.0 else "white",
        )  # fmt: skip


def _legend() -> list[Line2D]:
    controllers = [
        Line2D([], [], color=CONTROLLER[c], marker="o", label=f"{c} controller")
        for c in CONTROLLERS
    ]
    shares = [
        Line2D([], [], ls="", color="0.3", marker=marker, markerfacecolor=face, label=label)
        for marker, face, label in (
            ("o", "0.3", "all landed"), ("o", "white", "some landed"), ("x", "0.3", "none landed")
        )
    ]  # fmt: skip
    return [*controllers, *shares]
