"""The picture of learning: success and rise over the steps, for several seeds."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from experiments.shipped import CURVE_SUFFIX
from icub_jump_env.evaluation.statistics.summary import interquartile_mean
from icub_jump_env.evaluation.quantities import CM

_NAME = re.compile(r"(?P<group>velocity|torque)-seed\d+" + re.escape(CURVE_SUFFIX))
_COLORS = {"velocity": "tab:blue", "torque": "tab:orange"}


def learning_curves(folder: Path) -> Figure:
    """Each seed's evaluations as a thin line, their interquartile mean as a thick one.

    Args:
        folder: Holds the curves of the runs.
    """
    curves = defaultdict(list)
    for file in sorted(folder.glob(f"*{CURVE_SUFFIX}")):
        if match := _NAME.fullmatch(file.name):
            curves[match["group"]].append(json.loads(file.read_text())["evaluations"])
    figure = Figure(figsize=(9.0, 3.5), dpi=120, layout="constrained")
    panels = figure.subplots(1, 2)
    for axis, name, scale, label in (
        (panels[0], "success", 100.0, "success (%)"),
        (panels[1], "rise", CM, "mean CoM rise (cm)"),
    ):
        for group, runs in curves.items():
            color = _COLORS[group]
            common = min(map(len, runs))
            steps = np.array([point["timesteps"] for point in runs[0][:common]]) / 1000
            values = scale * np.array([[point[name] for point in run[:common]] for run in runs])
            axis.plot(steps, values.T, color=color, lw=0.6, alpha=0.5)
            mean = interquartile_mean(values, axis=0)
            axis.plot(steps, mean, color=color, lw=2.0, label=f"{group}, {len(runs)} seeds")
        axis.set(xlabel="steps (thousand)", ylabel=label)
        axis.spines[["top", "right"]].set_visible(False)
    panels[0].legend(frameon=False, loc="lower right")
    return figure
