"""The picture of a comparison: success and rise over the command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.figures.style import CONTENDERS, INK, Figure, panels
from icub_jump_env.evaluation.quantities import CM, PERCENT
from icub_jump_env.evaluation.statistics.summary import Summary, by_command, command_labels
from icub_jump_env.metrics.jump import SuccessConfig


def compare_figure(episodes: Mapping[str, Sequence[Episode]], success: SuccessConfig) -> Figure:
    """Success rates with Wilson intervals by command, and every episode's rise.

    Args:
        episodes: The episodes of each contender, by its name.
        success: What counts as a success.
    """
    figure, ((left, right),) = panels((9.0, 4.2), columns=2)
    shift = 0.8 / len(episodes)
    bars: dict[str, Artist] = {}
    for number, (name, series) in enumerate(episodes.items()):
        color = CONTENDERS[number % len(CONTENDERS)]
        groups = by_command(series)
        rates = [Summary.of(group).success for group in groups.values()]
        places = np.arange(len(groups)) + (number - (len(episodes) - 1) / 2) * shift
        shares = np.array([PERCENT * rate.share for rate in rates])
        bounds = np.array([rate.interval for rate in rates]).T * PERCENT
        errors = np.abs(bounds - shares)
        bar = left.bar(
            places, shares, 0.9 * shift, yerr=errors, color=color, label=name, capsize=2
        )
        bars[name] = bar.patches[0]
        names = [text.removesuffix(" cm") for text in command_labels(series).values()]
        left.set_xticks(range(len(groups)), names)
        for landed, marker in ((True, "."), (False, "x")):
            shown = [e for e in series if e.landed == landed]
            right.plot(
                [CM * e.jump_height for e in shown],
                [CM * e.jump["flight_height"] for e in shown],
                marker,
                ms=4,
                alpha=0.7,
                color=color,
                zorder=-number,  # the baseline is not hidden by the others
            )
    commands = [CM * e.jump_height for series in episodes.values() for e in series]
    ends = np.array([min(commands), max(commands)])
    meanings = {
        "landed": Line2D([], [], ls="", marker=".", color=INK),
        "fallen": Line2D([], [], ls="", marker="x", ms=4, color=INK),
        "command": right.plot(ends, ends, color="k", lw=0.8)[0],
        "least for a success": right.plot(ends, success.height_ratio * ends, "k:", lw=0.8)[0],
    }
    left.set(xlabel="command (cm)", ylabel="success (%)", ylim=(0, 103))
    right.set(xlabel="command (cm)", ylabel="CoM rise (cm)")
    interval = Line2D([], [], ls="", marker="|", ms=10, color="k")
    _name(figure, bars | {"95 % interval": interval}, loc="outside upper center", ncols=5)
    _name(right, meanings)
    return figure


def _name(where: Axes | Figure, artists: Mapping[str, Artist], **place: Any) -> None:
    """A legend that shows names as they are: matplotlib takes some signs in them for its own."""
    legend = where.legend(artists.values(), artists.keys(), frameon=False, fontsize=8, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)
