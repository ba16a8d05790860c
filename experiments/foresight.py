"""Are episodes that end early right about how they would have ended?

    python -m experiments.foresight

Each episode is played twice, with and without ``early_end``, with an action that is drawn for the
episode and stays, as an untrained policy might act: a third of the robots fall. Nothing was chosen
on the seeds.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from experiments.seeds import FORESIGHT_TEST
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.evaluation.quantities import CONTROLLERS, seeds
from icub_jump_env.evaluation.report.output import new_table, progress_display, show
from icub_jump_env.versions import VERSIONS

Array = NDArray[np.float32]

WORLDS = ("hard", "disturbed")
SPREAD = 0.4
"""Standard deviation of the actions."""


@dataclass(frozen=True)
class ForesightOptions:
    """Compare episodes that end early with whole ones.

    Attributes:
        episodes: Of each row, at most 125.
    """

    episodes: int = len(FORESIGHT_TEST)

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1, len(FORESIGHT_TEST))


class End(NamedTuple):
    """How an episode ended, after how many steps and how long a time (s)."""

    landed: bool
    steps: int
    wall: float


def play(env: ICubJumpEnv, seed: int, action: Array) -> End:
    """Play an episode with one action."""
    start = time.perf_counter()
    env.reset(seed=seed)
    for steps in itertools.count(1):
        *_, info = env.step(action)
        if info["outcome"] != "running":
            return End(info["jump"]["landed"], steps, time.perf_counter() - start)
    raise AssertionError  # unreachable: every episode ends


def drawn_action(seed: int) -> Array:
    """(3,) that of an episode."""
    action = np.random.default_rng(seed).normal(0.0, SPREAD, 3)
    return np.clip(action, -1.0, 1.0).astype(np.float32)


def compare(config: JumpConfig, of_seeds: Sequence[int]) -> list[tuple[End, End]]:
    """Early and whole ends of the same episodes."""
    early, whole = make_env(config.replace(early_end=True)), make_env(config)
    return [
        (play(early, seed, action), play(whole, seed, action))
        for seed, action in ((seed, drawn_action(seed)) for seed in of_seeds)
    ]


def add_row(table: Table, what: tuple[str, ...], ends: Sequence[tuple[End, End]]) -> None:
    """Add what was found to the table."""
    landed = [whole.landed for _, whole in ends]
    wrong = sum(early.landed is not whole.landed for early, whole in ends)
    steps = np.mean([(early.steps, whole.steps) for early, whole in ends], axis=0)
    walls = np.sum([(early.wall, whole.wall) for early, whole in ends], axis=0)
    table.add_row(
        *what,
        f"{100 * np.mean(landed):.0f}",
        f"{wrong}/{len(ends)}",
        *(f"{mean:.0f}" for mean in steps),
        f"{walls[1] / walls[0]:.1f}",
    )


def run(options: ForesightOptions) -> None:
    """Play, compare, print."""
    console, progress = Console(), Console(stderr=True)
    of_seeds = FORESIGHT_TEST[: options.episodes]
    table = new_table(
        3, "env", "controller", "worlds", "landed, %", "wrong", "steps", "of", "times faster",
        title=f"Episodes that end early, {seeds(of_seeds)}",
    )  # fmt: skip
    rows = list(itertools.product(VERSIONS, CONTROLLERS, WORLDS))
    found: list[tuple[End, End]] = []
    columns = TextColumn("playing"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with progress_display(progress, *columns) as display:
        for name, controller, worlds in display.track(rows):
            # Judged before there was a correction of the lean.
            config = JumpConfig.of(**VERSIONS[name]).replace(
                lean_correction=False,
                controller=controller,
                randomization=worlds,
                jump_height=(0.03, 0.06),
            )
            ends = compare(config, of_seeds)
            add_row(table, (name, controller, worlds), ends)
            found += ends
    table.add_section()
    add_row(table, ("all", "", ""), found)
    table.caption = (
        "landed: of whole episodes; wrong: episodes that end early and say otherwise; steps: means, "
        "early and whole; times faster: resets included"
    )
    show(console, table)


if __name__ == "__main__":
    guarded(lambda: run(parse(ForesightOptions, sys.argv[1:])))
