"""What corrects the launch for the lean: how it was tuned, and where it helps.

    python -m experiments.lean_correction --jobs 2

First several momenta of the launch per lean are tried in ``disturbed`` worlds. Then each regime of
:mod:`experiments.headroom` is jumped without and with what was chosen.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from experiments.headroom import REGIMES, Line, configuration, starts
from experiments.seeds import TUNING
from icub_jump_env.checks import check_choice, check_count
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT, seeds
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.planning.residual import AXES, ResidualConfig
from icub_jump_env.versions import VERSIONS, EnvName

GAINS = (0.0, 1.5, 3.0, 4.5, 6.0, 7.5, 9.0)
"""Momentum per lean backward that is tried (kg m^2/s per rad)."""


@dataclass(frozen=True)
class LeanOptions:
    """Tune the correction of the lean, and see where it helps.

    Attributes:
        jobs: Processes that work in parallel.
        episodes: Of each row, at most 200.
        env: The version of the environment.
    """

    jobs: int = 1
    episodes: int = 100
    env: EnvName = "ICubJump-v1"

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")
        check_count("episodes", self.episodes, 1, len(TUNING))
        check_choice("env", self.env, tuple(VERSIONS))


def tune(options: LeanOptions, progress: Console) -> Table:
    """Success with each momentum per lean."""
    on, scale = TUNING[: options.episodes], ResidualConfig.scale[AXES.index("pitch")]
    table = new_table(
        1, "controller", *(f"{gain:g}" for gain in GAINS),
        title=f"Success, %, by momentum per lean backward, {options.env}, disturbed, {seeds(on)}",
    )  # fmt: skip
    for controller in CONTROLLERS:
        config = configuration(options.env, "disturbed", controller, lean_correction=False)
        begun = starts(config, on)
        work = [
            Job(
                config, seed, Line("pitch", 0.0, -gain / scale * (start.lean[0] < 0)).policy(start)
            )
            for gain in GAINS
            for seed, start in zip(on, begun, strict=True)
        ]
        played = [episode.is_success for episode in run_all(work, options.jobs, progress)]
        success = np.mean(np.reshape(played, (len(GAINS), -1)), axis=1)
        table.add_row(controller, *(f"{PERCENT * share:.0f}" for share in success))
    return table


def compare(options: LeanOptions, progress: Console) -> Table:
    """Success, rise and height of the soles without and with it."""
    on = TUNING[: options.episodes]
    table = new_table(
        2, "regime", "controller", "success, %", "with it", "rise, cm", "with it",
        "soles, cm", "with it",
        title=f"Correction of the lean, {options.env}, 4 to 6 cm, {seeds(on)}, medians",
    )  # fmt: skip
    for regime, controller in itertools.product(REGIMES, CONTROLLERS):
        cells = []
        for corrected in (False, True):
            config = configuration(options.env, regime, controller, lean_correction=corrected)
            played = run_all([Job(config, seed) for seed in on], options.jobs, progress)
            cells.append(
                (
                    f"{PERCENT * np.mean([episode.is_success for episode in played]):.0f}",
                    *(
                        f"{CM * np.nanmedian([episode.jump[name] for episode in played]):.2f}"
                        for name in ("flight_height", "sole_height")
                    ),
                )
            )
        table.add_row(regime, controller, *itertools.chain(*zip(*cells, strict=True)))
    return table


def run(options: LeanOptions) -> None:
    """Measure and print."""
    console, progress = Console(), Console(stderr=True)
    show(console, tune(options, progress))
    show(console, compare(options, progress))


if __name__ == "__main__":
    guarded(lambda: run(parse(LeanOptions, sys.argv[1:])))
