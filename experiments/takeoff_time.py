"""Would it pay to let a residual choose when the launch ends?

    python -m experiments.takeoff_time

``ICubJump-v1`` in ``disturbed`` worlds, with launches that end earlier or later than planned. Hindsight
takes for each episode what succeeds in it, together with a neighbouring time, so that luck alone does
not count.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.headroom import configuration
from experiments.seeds import TUNING
from icub_jump_env.checks import check_count
from icub_jump_env.control.config import ControllerName, PhaseConfig
from icub_jump_env.control.phases import Phase, PhaseMachine
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT, seeds
from icub_jump_env.evaluation.report.output import new_table, progress_display, show

LATER = (-0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.02)
"""By which the launch ends later than planned (s)."""


@dataclass(frozen=True)
class TakeoffOptions:
    """Measure what another take-off time is worth.

    Attributes:
        episodes: Of each time, at most 200.
    """

    episodes: int = 100

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1, len(TUNING))


class Delayed(PhaseMachine):
    """Phases whose launch ends later than planned, or earlier."""

    def __init__(self, config: PhaseConfig, later: float) -> None:
        super().__init__(config)
        self._later = later

    def update(self, time: float, duration: float, normal_force: float) -> Phase:
        """One control tick, as in :class:`PhaseMachine`."""
        return super().update(time, duration + self._later, normal_force)


def play(
    controller: ControllerName, on: Sequence[int], progress: Console
) -> dict[float, list[Episode]]:
    """The episodes of each time."""
    config = configuration("ICubJump-v1", "disturbed", controller, lean_correction=True)
    played = {}
    with progress_display(progress) as display:
        for later in display.track(LATER, description=f"{controller} controller"):
            env = make_env(config)
            env._controller.phases = Delayed(config.controller_config.phases, later)
            played[later] = [run_episode(env, seed) for seed in on]
            env.close()
    return played


def hindsight(success: Mapping[float, NDArray[np.bool_]]) -> float:
    """Share of the episodes that succeed as planned, or at two neighbouring times (%)."""
    pairs = [one & other for one, other in itertools.pairwise(success.values())]
    return float(PERCENT * np.mean(success[0.0] | np.any(pairs, axis=0)))


def render(played: Mapping[str, Mapping[float, list[Episode]]], on: range) -> Table:
    """Success and rise at each time."""
    table = new_table(
        1, "controller", *(f"{1000 * later:+g} ms" for later in LATER), "hindsight",
        title=f"Success, %, and rise, cm, ICubJump-v1, disturbed, {seeds(on)}",
    )  # fmt: skip
    for controller, by_time in played.items():
        success = {
            later: np.array([each.is_success for each in episodes])
            for later, episodes in by_time.items()
        }
        table.add_row(
            controller,
            *(f"{PERCENT * np.mean(values):.0f}" for values in success.values()),
            f"{hindsight(success):.0f}",
        )
        rise = [
            np.mean([each.jump["flight_height"] or 0.0 for each in episodes])
            for episodes in by_time.values()
        ]
        table.add_row("", *(f"{CM * each:.2f}" for each in rise))
    return table


def run(options: TakeoffOptions) -> None:
    """Measure and print."""
    console, progress = Console(), Console(stderr=True)
    on = TUNING[: options.episodes]
    show(console, render({name: play(name, on, progress) for name in CONTROLLERS}, on))


if __name__ == "__main__":
    guarded(lambda: run(parse(TakeoffOptions, sys.argv[1:])))
