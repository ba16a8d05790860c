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

_COLUMNS = (
    ("flight_height", CM, "CoM rise (cm)"),
    ("flight_rotation", DEG, "rotation in flight (deg)"),
)


def realism_figure(results: Sequence[CaseResult]) -> Figure:
    """Rise and rotation of every case; medians with 10th and 90th percentile.

    Args:
        results: The study's results, grouped.

    Returns:
        One row of panels per group; how many landed shows in the markers.
    """
    groups = [(name, list(members)) for name, members in groupby(results, lambda r: r.case.group)]
    figure, axes = panels(
        (7.5, 10.0), len(groups), len(_COLUMNS), sharex="col", sharey="row",
        height_ratios=[len(members) + 0.5 for _, members in groups],
    )  # fmt: skip
    for (name, members), row in zip(groups, axes, strict=True):
        for axis, (metric, scale, label) in zip(row, _COLUMNS, strict=True):
            for offset, controller in zip((-0.12, 0.12), CONTROLLERS, strict=True):
                _points(axis, members, controller, metric, scale, offset)
            axis.axvline(0.0, color="0.8", lw=0.8)
            axis.grid(axis="y", color="0.9")
            axis.tick_params(labelbottom=True)
            if members is groups[-1][1]:
                axis.set_xlabel(label)
        row[0].set_title(name, fontsize=10, loc="left")
        row[0].set_yticks(range(len(members)), [r.case.label for r in members], fontsize=9)
        row[0].set_ylim(len(members) - 0.5, -0.5)
    figure.legend(handles=_legend(), loc="outside lower center", ncols=3, frameon=False)
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
    for y, result in enumerate(members):
        summary = result.summaries[controller]
        low, middle, high = scale * np.array(summary.percentiles[metric])
        axis.plot([low, high], [y + offset] * 2, color=color, lw=1.5)
        share = summary.landed.share
        axis.plot(
            middle, y + offset, ls="", color=color, ms=5,
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
    spread = Line2D([], [], color="0.3", lw=1.5, label="10 to 90 % of episodes")
    return [*controllers, *shares, spread]
