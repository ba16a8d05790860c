"""The default mode of eval.py: the jump with and without the momentum constraint."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.output import progress_display, say, show, write_json
from icub_jump_env.evaluation.provenance import command, provenance
from icub_jump_env.evaluation.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.evaluation.table import comparison_rows, render_table, verdict


@dataclass(frozen=True)
class Arm:
    """The jump with one setting of the momentum constraint."""

    config: JumpConfig
    episode: Episode

    @property
    def name(self) -> str:
        """Whether the momentum constraint is posed."""
        return "with" if self.config.momentum_control else "without"


def run_nominal(config: JumpConfig, seed: int, trace: bool, console: Console) -> tuple[Arm, Arm]:
    """Jump as configured, and with the momentum constraint switched over.

    Args:
        config: The jump.
        seed: Seed of both.
        trace: Whether the episodes carry snapshots.
        console: Where the progress is shown.

    Returns:
        The arm as configured and the other one.
    """
    with progress_display(console) as progress:
        task = progress.add_task("jumping", total=2)
        arms = []
        for momentum_control in (config.momentum_control, not config.momentum_control):
            arm_config = dataclasses.replace(config, momentum_control=momentum_control)
            env = make_env(traced(arm_config) if trace else arm_config)
            arms.append(Arm(arm_config, run_episode(env, seed, trace)))
            env.close()
            progress.advance(task)
    return arms[0], arms[1]


def print_nominal(options: EvalOptions, console: Console, progress: Console) -> None:
    """Run eval.py without a mode."""
    config = options.config
    if options.plot is not None:
        from icub_jump_env.evaluation.figures import realistic

        realistic(config)  # refuses before any work what Fig. 4 cannot be drawn of
    arms = run_nominal(config, options.seed, trace=options.plot is not None, console=progress)
    ours, other = (arm.episode for arm in arms)
    wrote = []
    if options.json is not None:
        write_json(options.json, nominal_report(arms, options.seed))
        wrote.append(options.json)
    if options.plot is not None:
        wrote += _draw(arms, options, progress)
    rows = comparison_rows(config, ours, other)
    title = (
        f"{config.jump_height * 100:g} cm jump, {config.controller} controller; "
        "the paper's: 4 cm after 11 cm"
    )
    show(console, render_table(rows, title, config.momentum_control))
    say(console, verdict(rows, config.momentum_control))
    for file in wrote:
        say(console, f"wrote {file}")


def _draw(arms: Sequence[Arm], options: EvalOptions, progress: Console) -> list[Path]:
    from icub_jump_env.evaluation.figures import draw_figures
    from icub_jump_env.evaluation.snapshots import snapshot_strip

    assert options.plot is not None  # else nothing is to be drawn
    episodes = {arm.name: arm.episode for arm in arms}
    files = draw_figures(options.plot, options.config, episodes, options.seed)
    try:
        strip = snapshot_strip(options.config, options.seed)
    except MissingDependencyError as error:
        say(progress, f"left out Fig. 5: {error}")
    else:
        files.append(options.plot / "fig5_snapshots.png")
        strip.savefig(files[-1])
    return files


def nominal_report(arms: Sequence[Arm], seed: int) -> dict[str, Any]:
    """Everything eval.py found, for ``--json``."""
    ours, other = arms
    return {
        "mode": "nominal",
        "command": command(),
        **provenance(ours.config, seed),
        "arms": {
            arm.name: {
                "momentum_control": arm.config.momentum_control,
                "outcome": arm.episode.outcome,
                "is_success": arm.episode.is_success,
                "failure": arm.episode.failure,
                "jump": arm.episode.jump,
            }
            for arm in arms
        },
        "comparison": [
            dataclasses.asdict(row)
            for row in comparison_rows(ours.config, ours.episode, other.episode)
        ],
    }
