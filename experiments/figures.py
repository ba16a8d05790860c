"""The picture of the frontier."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from icub_jump_env.evaluation.quantities import CM

if TYPE_CHECKING:
    from experiments.frontier import Point


def frontier_figure(points: Sequence[Point]) -> Figure:
    """Mean rise over the success rate; labels name command and displacement (cm)."""
    figure = Figure(figsize=(6.5, 4.2), dpi=120, layout="constrained")
    axis = figure.subplots()
    names = dict.fromkeys(point.contender.name for point in points)
    for name, color in zip(names, ("0.55", "tab:blue", "tab:green"), strict=True):
        shown = [p for p in points if p.contender.name == name]
        shares = [100 * p.summary.success.share for p in shown]
        rises = [CM * p.summary.mean_rise for p in shown]
        axis.plot(shares, rises, "o", color=color, label=name)
        for point, share, rise in zip(shown, shares, rises, strict=True):
            axis.annotate(
                f"{CM * point.jump_height:g}/{CM * point.displacement:g}",
                (share, rise),
                textcoords="offset points",
                xytext=(4, 3),
                fontsize=7,
                color=color,
            )
    axis.set(xlabel="success (%)", ylabel="mean CoM rise (cm)")
    axis.set_title("command / displacement (cm)", fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False)
    return figure
