"""The picture of the landing study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D

from icub_jump_env.evaluation.figures.style import Figure, figure_of
from icub_jump_env.evaluation.modes.landing_cases import FLIGHT_TIME, HOLD, VARIANTS, Disturbance
from icub_jump_env.evaluation.quantities import PERCENT
from icub_jump_env.evaluation.statistics.summary import Rate

if TYPE_CHECKING:
    from icub_jump_env.evaluation.modes.landing_study import LandingResult, Results

# Okabe and Ito's colours, which differ for every kind of colour vision.
_STYLES = dict(
    zip(
        VARIANTS,
        (("#000000", "o", "-"), ("#e69f00", "s", "--"), ("#0072b2", "^", "-."), ("#d55e00", "D", ":")),
        strict=True,
    )
)  # fmt: skip
"""Colour, marker and line of each variant."""

_COLUMNS = 4
_SPAN = 2
"""Columns of the panel without disturbance."""
_SPREAD = 0.06
"""Distance of the outer variants' points, which else hide each other, as a share of a panel."""
_LABEL_DISTANCE = 0.09
"""Least distance of the sizes that are labelled, as a share of a panel."""

_NOTE = (
    "Jumps of 4 cm, full, without disturbance at size 0. Rotation: spin at lift-off times "
    f"{FLIGHT_TIME:g} s. Pushes in m/s: impulse divided by the robot's nominal mass.\n"
    "Significant: the 95 % interval of the paired difference in the standing rate leaves out zero."
)


def landing_figure(results: Results, disturbances: Sequence[Disturbance]) -> Figure:
    """Standing rates over the size of each disturbance.

    Args:
        results: The study's results by controller.
        disturbances: What disturbs the jump.

    Returns:
        A block of panels for each controller.
    """
    figure = figure_of((11.0, 14.5))
    blocks = figure.subfigures(len(results), 1, squeeze=False, hspace=0.03)[:, 0]
    for block, (controller, done) in zip(blocks, results.items(), strict=True):
        block.suptitle(f"{controller} controller", fontsize=12, fontweight="bold")
        _block(block, done, disturbances)
    total = next(iter(results.values()))[0].summaries[HOLD].landed.total
    figure.legend(
        handles=_legend(total), loc="outside lower center", ncols=4, frameon=False, fontsize=9,
        title=_NOTE, title_fontsize=8,
    )  # fmt: skip
    return figure


def _block(
    figure: SubFigure, results: Sequence[LandingResult], disturbances: Sequence[Disturbance]
) -> None:
    rows = -(-(len(disturbances) + _SPAN) // _COLUMNS)
    grid = figure.add_gridspec(rows, _COLUMNS)
    places = [divmod(_SPAN + number, _COLUMNS) for number in range(len(disturbances))]
    plain = [result for result in results if result.case.size is None]
    axis = figure.add_subplot(grid[0, :_SPAN])
    _panel(axis, range(len(plain)), plain, joined=False)
    axis.set_title("without disturbance", fontsize=10)
    labels = [
        result.case.label.replace(" after", "\nafter")
        .replace(" plan", "\nplan")
        .replace(", ", ",\n")
        for result in plain
    ]
    axis.set_xticks(range(len(plain)), labels, fontsize=7)
    axis.set_ylabel("standing (%)")
    for disturbance, (row, column) in zip(disturbances, places, strict=True):
        sized = {0.0: results[0]} | {
            result.case.size: result
            for result in results
            if result.case.group == disturbance.name and result.case.size is not None
        }
        sizes = sorted(sized)
        axis = figure.add_subplot(grid[row, column])
        _panel(axis, sizes, [sized[size] for size in sizes], joined=True)
        axis.set_title(disturbance.name, fontsize=10)
        axis.set_xlabel(disturbance.scale, fontsize=9)
        axis.set_xticks(sizes, _labels(sizes), fontsize=8)
        if column == 0:
            axis.set_ylabel("standing (%)")


def _panel(
    axis: Axes, places: Sequence[float], results: Sequence[LandingResult], joined: bool
) -> None:
    """Rates of some cases at their places on the abscissa."""
    axis.set(ylim=(-4, 104), yticks=range(0, 101, 25))
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="y", color="0.9")
    width = (max(places) - min(places)) or 1.0
    shifts = np.linspace(-0.5, 0.5, len(VARIANTS)) * _SPREAD * width
    for variant, shift in zip(VARIANTS, shifts, strict=True):
        rates = [result.summaries[variant].landed for result in results]
        signs = [variant == HOLD or result.sign(variant) != 0 for result in results]
        _series(axis, np.array(places) + shift, rates, signs, variant, joined)
    axis.set_xlim(min(places) - 0.08 * width, max(places) + 0.08 * width)


def _series(
    axis: Axes,
    x: np.ndarray,
    rates: Sequence[Rate],
    filled: Sequence[bool],
    variant: str,
    joined: bool,
) -> None:
    color, marker, line = _STYLES[variant]
    shares = PERCENT * np.array([rate.share for rate in rates])
    bounds = PERCENT * np.array([rate.interval for rate in rates])
    axis.vlines(x, bounds[:, 0], bounds[:, 1], color=color, lw=1.0)
    if joined:
        axis.plot(x, shares, line, color=color, lw=1.0)
    for place, share, full in zip(x, shares, filled, strict=True):
        axis.plot(
            place, share, marker, color=color, ms=4.5, markerfacecolor=color if full else "white"
        )


def _labels(sizes: Sequence[float]) -> list[str]:
    """A label for each size (ascending); none for those that are too near to the one before."""
    least = _LABEL_DISTANCE * (sizes[-1] - sizes[0])
    labels, last = [], -math.inf
    for size in sizes:
        shown = size - last >= least
        labels.append(f"{size:g}" if shown else "")
        last = size if shown else last
    return labels


def _legend(total: int) -> list[Line2D]:
    """What the marks mean, column by column; ``total`` is the number of episodes of a point."""
    hold, *others = (
        Line2D([], [], color=color, marker=marker, ls=line, ms=5, label=variant)
        for variant, (color, marker, line) in _STYLES.items()
    )
    filled, empty = (
        Line2D([], [], ls="", marker="D", ms=5, color="0.4", markerfacecolor=face, label=label)
        for face, label in (
            ("0.4", "differs significantly from hold"), ("white", "does not differ significantly")
        )
    )  # fmt: skip
    stem = Line2D([], [], ls="", marker="|", ms=12, color="0.4")
    stem.set_label(f"95 % interval, {total} episodes")
    return [hold, filled, others[0], empty, others[1], stem, others[2]]
