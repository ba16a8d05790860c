"""The picture of many episodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.figures.style import ACCENT, DESIRED, MEASURED, Figure, panels
from icub_jump_env.evaluation.quantities import CM, DEG
from icub_jump_env.metrics.jump import SuccessConfig

_MARKERS = {
    None: "o",
    Failure.DIVERGED: "*",
    Failure.NO_TAKEOFF: "v",
    Failure.OVER_ROTATED: "x",
    Failure.SLIPPED: "s",
    Failure.FELL_FORWARD: ">",
    Failure.FELL_BACKWARD: "<",
    Failure.FELL_SIDEWAYS: "D",
    Failure.TOO_LOW: "_",
}


def statistics_figure(episodes: Sequence[Episode], success: SuccessConfig) -> Figure:
    """Rise and rotation of every episode; failures by class.

    The rise is drawn in units of the command where each episode has its own.

    Args:
        episodes: The episodes.
        success: What counts as a success.
    """
    alike = len({e.jump_height for e in episodes}) == 1
    # A length of 1 on the x axis: a centimetre, or the command.
    unit = {e.seed: 1 / CM if alike else e.jump_height for e in episodes}
    command = CM * episodes[0].jump_height if alike else 1.0
    figure, ((axis,),) = panels((6.5, 4.0))
    for kind, marker in _MARKERS.items():
        shown = [e for e in episodes if e.failure is kind]
        if shown:
            axis.plot(
                [e.jump["flight_height"] / unit[e.seed] for e in shown],
                # Without a flight there is no rotation.
                [DEG * np.nan_to_num(e.jump["flight_rotation"]) for e in shown],
                marker,
                color=MEASURED if kind is None else DESIRED,
                ms=4 if kind is None else 7,
                label=f"{kind or 'success'}: {len(shown)}",
            )
    axis.axvline(command, color=ACCENT, lw=0.8, label="command")
    least = success.height_ratio * command
    axis.axvline(least, color=ACCENT, lw=0.8, ls=":", label="least for a success")
    axis.set_xlabel("CoM rise (cm)" if alike else "CoM rise / commanded height")
    axis.set_ylabel("rotation in flight (deg)")
    axis.legend(frameon=False, fontsize=8)
    return figure
