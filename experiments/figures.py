"""The pictures of the evidence."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from experiments.shipped import CURVE_SUFFIX
from icub_jump_env.evaluation.figures.style import (
    ACCENT,
    CONTENDERS,
    CONTROLLER,
    DESIRED,
    INK,
    MEASURED,
    Figure,
    describe,
    panels,
)
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT
from icub_jump_env.evaluation.statistics.intervals import interquartile_mean
from icub_jump_env.planning.residual import AXES, COM_AXES, ResidualConfig

if TYPE_CHECKING:
    from experiments.feedback import Launches
    from experiments.frontier import Point
    from experiments.planners import Point as PlannerPoint

Place = tuple[float, float]
"""Of a point, in the units of the axes."""


def frontier_figure(points: Sequence[Point], chosen: Sequence[Point]) -> Figure:
    """Mean rise over the success rate; labels name the displacement (cm) of baselines.

    Args:
        points: The grid.
        chosen: Those of it that meet the policy.
    """
    figure, ((axis,),) = panels((7.5, 4.2))
    baseline, constant, _, policy, *_ = CONTENDERS
    names = dict.fromkeys(point.contender.name for point in points)
    colors = dict(zip(names, (baseline, constant, policy), strict=True))
    heights = sorted({point.jump_height for point in points})
    markers = dict(zip(heights, ("o", "s", "^", "D"), strict=False))
    labels: dict[Place, str] = {}
    for point in points:
        place = PERCENT * point.summary.success.share, CM * point.summary.mean_rise
        color = colors[point.contender.name]
        axis.plot(*place, markers[point.jump_height], color=color, ms=6)
        if color == baseline:
            labels[place] = f"{CM * point.displacement:g}"
        if point in chosen:
            axis.plot(*place, "o", ms=13, mfc="none", mec="k")
    shown: list[tuple[str, dict[str, Any]]] = [
        *((name, {"marker": "o", "color": color}) for name, color in colors.items()),
        *(
            (f"{CM * h:g} cm", {"marker": m, "color": INK, "mfc": "none"})
            for h, m in markers.items()
        ),
        ("strongest baselines", {"marker": "o", "color": "k", "mfc": "none", "ms": 13}),
    ]
    handles = [Line2D([], [], ls="", label=label, **look) for label, look in shown]
    axis.legend(
        handles=handles, frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5)
    )
    axis.set(xlabel="success (%)", ylabel="mean CoM rise (cm)")
    _write(figure, axis, labels, baseline)
    axis.set_title("marks: command; numbers: displacement of baselines (cm)", fontsize=9)
    return figure


def _write(figure: Figure, axis: Axes, labels: Mapping[Place, str], color: str) -> None:
    """Write each label on the side of its point with the most room."""
    figure.draw_without_rendering()  # which lays out the axes
    points = (xy for line in axis.lines for xy in np.asarray(line.get_xydata()))
    taken = [axis.transData.transform(xy) for xy in points]
    taken += [text.get_window_extent().get_points().mean(axis=0) for text in axis.texts]
    for place, label in labels.items():
        here = axis.transData.transform(place)
        others = np.array([other for other in taken if np.hypot(*(other - here)) > 1.0])
        sides = [np.array(side) * figure.dpi / 72 for side in _SIDES]
        room = [np.hypot(*(others - here - side).T).min() for side in sides]
        side = int(np.argmax(room))
        axis.annotate(
            label, place, textcoords="offset points", xytext=_SIDES[side],
            ha="center", va="center", fontsize=8, color=color,
        )  # fmt: skip
        taken.append(here + sides[side])


_SIDES = ((11, 7), (11, -7), (-11, 7), (-11, -7))
"""Where a label may be, beside its point (points of 1/72 inch)."""


def planners_figure(points: Sequence[PlannerPoint]) -> Figure:
    """Mean rise over the landing rate, a panel for each controller and world; labels name the command.

    Commands below 5 cm, which all land, would hide each other.
    """
    figure, axes = panels((8.0, 7.4), 2, len(CONTROLLERS), sharex=True, sharey=True)
    colors = dict(zip(("scaled_curve", "whole_body"), (DESIRED, MEASURED), strict=True))
    cells = itertools.product(("full", "hard"), CONTROLLERS)
    for axis, (world, controller) in zip(axes.flat, cells, strict=True):
        labels: dict[str, dict[Place, str]] = {}
        for planner, color in colors.items():
            shown = [
                p
                for p in points
                if (p.controller, p.planner, p.world) == (controller, planner, world)
                and p.jump_height >= 0.05
            ]
            share = PERCENT * np.array([p.landed.share for p in shown])
            rise = CM * np.array([p.rises.mean() for p in shown])
            shares = PERCENT * np.array([p.landed.interval for p in shown]).T
            rises = CM * np.array([p.rise_interval for p in shown]).T
            axis.errorbar(
                share, rise, np.abs(rises - rise), np.abs(shares - share), "o", color=color,
                elinewidth=0.7, ms=5,
            )  # fmt: skip
            places = zip(share.tolist(), rise.tolist(), strict=True)
            labels[color] = {
                place: f"{CM * point.jump_height:g}"
                for place, point in zip(places, shown, strict=True)
            }
        axis.set_title(f"{controller} controller, {world}", fontsize=10)
        axis.set(xlim=(0, 112), ylim=(0, 8))
        for color, of_planner in labels.items():
            _write(figure, axis, of_planner, color)
    for axis in axes[-1]:
        axis.set_xlabel("landed (%)")
    for axis in axes[:, 0]:
        axis.set_ylabel("mean CoM rise (cm)")
    handles = [Line2D([], [], color=c, marker="o", lw=0.7, label=n) for n, c in colors.items()]
    figure.legend(
        handles=handles, loc="outside lower center", frameon=False, ncols=2,
        title="numbers: command from 5 cm on (cm); lines: 95 % intervals",
    )  # fmt: skip
    return figure


def learning_curves(folder: Path, task: str = "") -> Figure:
    """Each seed's evaluations as a thin line, their interquartile mean as a thick one.

    Args:
        folder: Holds the curves of the runs.
        task: What their names begin with before the controller: ``"disturbed-"``.
    """
    runs = {
        controller: [
            json.loads(file.read_text())["evaluations"]
            for file in sorted(folder.glob(f"{task}{controller}-seed*{CURVE_SUFFIX}"))
        ]
        for controller in CONTROLLERS
    }
    figure, ((left, right),) = panels((9.0, 3.8), columns=2)
    for axis, name, scale, label in (
        (left, "success", PERCENT, "success (%)"),
        (right, "rise", CM, "mean CoM rise (cm)"),
    ):
        for controller, curves in runs.items():
            if not curves:
                continue
            color = CONTROLLER[controller]
            common = min(map(len, curves))
            steps = np.array([point["timesteps"] for point in curves[0][:common]]) / 1000
            values = scale * np.array([[point[name] for point in c[:common]] for c in curves])
            lines = axis.plot(steps, values.T, color=color, lw=0.6, alpha=0.5)
            lines[0].set_label(f"{controller}, each of {len(curves)} seeds")
            mean = interquartile_mean(values, axis=0)
            axis.plot(
                steps,
                mean,
                "o-",
                color=color,
                ms=4,
                lw=2.0,
                label=f"{controller}, interquartile mean",
            )
        axis.set(xlabel="steps (thousand)", ylabel=label)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def feedback_figure(launches: Launches, residual: ResidualConfig) -> Figure:
    """What a policy does by the slope of the ground, and around a push; quartiles as bands.

    Args:
        launches: In which it was watched.
        residual: What its actions mean.
    """
    figure, rows = panels((9.0, 5.0), rows=2, columns=len(residual.axes), sharey="col")
    steep, hard = math.radians(2.0), 3.0
    slopes = {
        "rises ahead": launches.slope > steep,
        "level": np.abs(launches.slope) < steep / 2,
        "falls ahead": launches.slope < -steep,
    }
    pushes = {
        "pushed forward": launches.push > hard,
        "hardly pushed": np.abs(launches.push) < hard / 2,
        "pushed backward": launches.push < -hard,
    }
    since = 1000 * (launches.time[None, :] - launches.push_time[:, None])
    edges = np.arange(-100.0, 220.0, 20.0)
    middles = (edges[:-1] + edges[1:]) / 2
    for column, name in enumerate(residual.axes):
        scale, unit = residual.scale[AXES.index(name)], "kg m²/s"
        if name in COM_AXES:
            scale, unit = CM * scale, "cm"
        values = scale * launches.actions[:, :, column]
        for label, color, chosen in _groups(slopes):
            _band(rows[0, column], 1000 * launches.time, values[chosen].T, color, label)
        for label, color, chosen in _groups(pushes):
            bins = [
                values[chosen][(since[chosen] >= low) & (since[chosen] < high)]
                for low, high in itertools.pairwise(edges)
            ]
            _band(rows[1, column], middles, bins, color, label)
        moved = f"{name} residual ({unit})"
        describe(rows[0, column], "by the slope of the ground", moved, "time (ms)")
        describe(rows[1, column], "around a push", moved, "time since its end (ms)")
        for axis in rows[:, column]:
            axis.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    for row in rows:
        row[0].legend(frameon=False, fontsize=8)
    marks = Line2D([], [], color=INK, lw=1.8), Patch(color=INK, alpha=0.2, lw=0)
    figure.legend(
        marks, ("median of the episodes", "quartiles"),
        loc="outside lower center", ncols=2, frameon=False, fontsize=8,
    )  # fmt: skip
    return figure


def _groups(groups: Mapping[str, NDArray[np.bool_]]) -> Iterator[tuple[str, str, Any]]:
    for (label, chosen), color in zip(groups.items(), (DESIRED, ACCENT, MEASURED), strict=True):
        yield label, color, chosen


def _band(axis: Axes, x: Any, values: Sequence[Any], color: str, label: str) -> None:
    """Quartiles of the values at each x, as far as there are any."""
    low, middle, high = np.array(
        [np.percentile(each, [25, 50, 75]) if len(each) else [np.nan] * 3 for each in values]
    ).T
    axis.fill_between(x, low, high, color=color, alpha=0.2, lw=0)
    axis.plot(x, middle, color=color, lw=1.8, label=label)
