"""The default mode of eval.py: the jump with and without the momentum constraint."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.progress import Progress

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.provenance import provenance
from icub_jump_env.evaluation.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.evaluation.table import comparison_rows


@dataclass(frozen=True)
class Arm:
    """Episodes of one configuration."""

    name: str
    config: JumpConfig
    episodes: tuple[Episode, ...]


def run_nominal(
    config: JumpConfig, episodes: int, seed: int, trace: bool, console: Console
) -> tuple[Arm, Arm]:
    """Jump with and without the momentum constraint.

    Args:
        config: The jump; its ``momentum_control`` is set by the arms.
        episodes: Episodes of each arm, seeded ``seed``, ``seed + 1``, ...
        seed: First seed.
        trace: Whether the episodes carry snapshots.
        console: Where the progress is shown.

    Returns:
        The arm with the constraint and the one without.
    """
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("jumping", total=2 * episodes)
        arms = []
        for name, momentum_control in (("with", True), ("without", False)):
            arm_config = dataclasses.replace(config, momentum_control=momentum_control)
            env = make_env(traced(arm_config) if trace else arm_config)
            done = []
            for index in range(episodes):
                done.append(run_episode(env, seed + index, trace))
                progress.advance(task)
            env.close()
            arms.append(Arm(name, arm_config, tuple(done)))
    return arms[0], arms[1]


def nominal_report(arms: Sequence[Arm], seed: int) -> dict[str, Any]:
    """Everything eval.py found, for ``--json``."""
    with_momentum, without = arms
    return {
        "mode": "nominal",
        **provenance(with_momentum.config, seed),
        "arms": {
            arm.name: {
                "momentum_control": arm.config.momentum_control,
                "episodes": [
                    {
                        "seed": episode.seed,
                        "outcome": episode.outcome,
                        "is_success": episode.is_success,
                        "jump": episode.jump,
                    }
                    for episode in arm.episodes
                ],
            }
            for arm in arms
        },
        "comparison": [
            dataclasses.asdict(row)
            for row in comparison_rows(with_momentum.episodes, without.episodes)
        ],
    }
