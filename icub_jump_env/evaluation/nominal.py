"""The default mode of eval.py: the jump with and without the momentum constraint."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.output import progress_display
from icub_jump_env.evaluation.provenance import provenance
from icub_jump_env.evaluation.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.evaluation.table import comparison_rows


@dataclass(frozen=True)
class Arm:
    """Episodes of one configuration."""

    config: JumpConfig
    episodes: tuple[Episode, ...]

    @property
    def name(self) -> str:
        """Whether the momentum constraint is posed."""
        return "with" if self.config.momentum_control else "without"


def run_nominal(
    config: JumpConfig, episodes: int, seed: int, trace: bool, console: Console
) -> tuple[Arm, Arm]:
    """Jump as configured, and with the momentum constraint switched over.

    Args:
        config: The jump.
        episodes: Episodes of each arm, seeded ``seed``, ``seed + 1``, ...
        seed: First seed.
        trace: Whether the episodes carry snapshots.
        console: Where the progress is shown.

    Returns:
        The arm as configured and the other one.
    """
    with progress_display(console) as progress:
        task = progress.add_task("jumping", total=2 * episodes)
        arms = []
        for momentum_control in (config.momentum_control, not config.momentum_control):
            arm_config = dataclasses.replace(config, momentum_control=momentum_control)
            env = make_env(traced(arm_config) if trace else arm_config)
            done = []
            for index in range(episodes):
                done.append(run_episode(env, seed + index, trace))
                progress.advance(task)
            env.close()
            arms.append(Arm(arm_config, tuple(done)))
    return arms[0], arms[1]


def nominal_report(arms: Sequence[Arm], seed: int) -> dict[str, Any]:
    """Everything eval.py found, for ``--json``."""
    ours, other = arms
    return {
        "mode": "nominal",
        **provenance(ours.config, seed),
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
            for row in comparison_rows(ours.config, ours.episodes, other.episodes)
        ],
    }
