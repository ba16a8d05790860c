"""The pictures of the evidence."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments.shipped import CURVE_SUFFIX
from icub_jump_env.evaluation.figures.style import (
    CONTENDERS,
    CONTROLLER,
    DESIRED,
    MEASURED,
    Figure,
    panels,
)
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT
from icub_jump_env.evaluation.statistics.intervals import interquartile_mean

if TYPE_CHECKING:
    from experiments.frontier import Point
    from experiments.planners import Point as PlannerPoint


def frontier_figure(points: Sequence[Point], chosen: Sequence[Point]) -> Figure:
    """Mean rise over the success rate; labels name command and displacement (cm).

    Args:
        points: The grid.
        chosen: Those of it that meet the policy.
    """
    figure, ((axis,),) = panels((6.5, 4.2))
    names = dict.fromkeys(point.contender.name for point in points)
    baseline, constant, _, policy, *_ = CONTENDERS
    for name, color in zip(names, (baseline, constant, policy), strict=True):
        shown = [p for p in points if p.contender.name == name]
        shares = [PERCENT * p.summary.success.share for p in shown]
        rises = [CM * p.summary.mean_rise for p in shown]
        axis.plot(shares, rises, "o", color=color, label=name)
        for point, share, rise in zip(shown, shares, rises, strict=True):
            axis.annotate(
                f"{CM * point.jump_height:g}/{CM * point.displacement:g}",
                (share, rise),
                textcoords="offset points",
                xytext=(6, 4),
                fontsize=7,
                color=color,
            )
    axis.plot(
        [PERCENT * point.summary.success.share for point in chosen],
        [CM * point.summary.mean_rise for point in chosen],
        "o",
        ms=11,
        mfc="none",
        mec="k",
        label="meet the policy",
    )
    axis.set(xlabel="success (%)", ylabel="mean CoM rise (cm)")
    axis.set_title("command / displacement (cm)", fontsize=9)
    axis.legend(frameon=False)
    return figure


def planners_figure(points: Sequence[PlannerPoint]) -> Figure:
    """Mean rise over the landing rate, a panel for each controller; labels name the command (cm).

    Commands below 5 cm, which all land, would hide each other.
    """
    figure, (axes,) = panels((10.0, 4.6), columns=len(CONTROLLERS), sharey=True)
    colors = dict(zip(("scaled_curve", "whole_body"), (DESIRED, MEASURED), strict=True))
    fills = {"full": "full", "hard": "none"}
    for axis, controller in zip(axes, CONTROLLERS, strict=True):
        for (planner, color), (world, fill) in itertools.product(colors.items(), fills.items()):
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
                fillstyle=fill, elinewidth=0.7, ms=5, label=f"{planner}, {world}",
            )  # fmt: skip
            left = fill == "none"
            for k, (x, y, point) in enumerate(zip(share, rise, shown, strict=True)):
                # Neighbours in turn below and above.
                axis.annotate(
                    f"{CM * point.jump_height:g}", (x, y), textcoords="offset points",
                    xytext=(-6 if left else 6, 4 if k % 2 else -10),
                    ha="right" if left else "left", fontsize=8, color=color,
                )  # fmt: skip
        axis.set_title(f"{controller} controller", fontsize=10)
        axis.set(xlabel="landed (%)", xlim=(0, 107), ylim=(3, 8))
    axes[0].set_ylabel("mean CoM rise (cm)")
    axes[0].legend(frameon=False, loc="lower left", fontsize=8)
    return figure


def learning_curves(folder: Path) -> Figure:
    """Each seed's evaluations as a thin line, their interquartile mean as a thick one.

    Args:
        folder: Holds the curves of the runs.
    """
    runs = {
        controller: [
            json.loads(file.read_text())["evaluations"]
            for file in sorted(folder.glob(f"{controller}-seed*{CURVE_SUFFIX}"))
        ]
        for controller in CONTROLLERS
    }
    figure, ((left, right),) = panels((9.0, 3.5), columns=2)
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
            axis.plot(steps, values.T, color=color, lw=0.6, alpha=0.5)
            mean = interquartile_mean(values, axis=0)
            axis.plot(steps, mean, color=color, lw=2.0, label=f"{controller}, {len(curves)} seeds")
        axis.set(xlabel="steps (thousand)", ylabel=label)
    left.legend(frameon=False, loc="lower right")
    return figure
