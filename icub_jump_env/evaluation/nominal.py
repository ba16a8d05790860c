"""The default mode of eval.py: one jump beside the paper's, and beside another one.

The other one is the jump without the momentum constraint; of a policy, the baseline.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.contender import BASELINE, Contender
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.output import progress_display, save_figure, say, show, write_json
from icub_jump_env.evaluation.provenance import command, provenance
from icub_jump_env.evaluation.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.evaluation.table import comparison_rows, render_table, verdict
from icub_jump_env.reference.com_trajectory import plan_com_trajectory


@dataclass(frozen=True)
class Arm:
    """One of the two jumps."""

    name: str
    config: JumpConfig
    contender: Contender
    episode: Episode


def run_nominal(
    config: JumpConfig,
    seed: int,
    trace: bool,
    console: Console,
    contender: Contender = BASELINE,
) -> tuple[Arm, Arm]:
    """Jump as asked for, and the other jump.

    Args:
        config: The jump.
        seed: Seed of both.
        trace: Whether the episodes carry snapshots.
        console: Where the progress is shown.
        contender: What acts.

    Returns:
        The arm as asked for and the other one.
    """
    if contender.is_baseline:
        switched = dataclasses.replace(config, momentum_control=not config.momentum_control)
        jumps = [(_momentum(c), c, contender) for c in (config, switched)]
    else:
        jumps = [("policy", config, contender), ("baseline", config, BASELINE)]
    with progress_display(console) as progress:
        task = progress.add_task("jumping", total=2)
        arms = []
        for name, arm_config, acting in jumps:
            env = make_env(traced(arm_config) if trace else arm_config)
            hold = arm_config.controls_per_step if trace else 1
            episode = run_episode(env, seed, acting.policy, trace, hold=hold)
            arms.append(Arm(name, arm_config, acting, episode))
            env.close()
            progress.advance(task)
    return arms[0], arms[1]


def _momentum(config: JumpConfig) -> str:
    return "with" if config.momentum_control else "without"


def print_nominal(
    options: EvalOptions, contender: Contender, console: Console, progress: Console
) -> None:
    """Run eval.py without a mode."""
    config = options.config
    if options.plot is not None and contender.is_baseline:
        from icub_jump_env.evaluation.figures import realistic

        realistic(config)  # refuses before any work what Fig. 4 cannot be drawn of
    arms = run_nominal(config, options.seed, options.plot is not None, progress, contender)
    ours, other = (arm.episode for arm in arms)
    wrote = []
    if options.json is not None:
        write_json(options.json, nominal_report(arms, options.seed))
        wrote.append(options.json)
    if options.plot is not None:
        draw = _draw_paper if contender.is_baseline else _draw_policy
        wrote += draw(arms, options, progress)
    rows = comparison_rows(config, ours, other)
    title = f"{config.commanded_height * 100:g} cm jump, {config.controller} controller"
    paper = "; the paper's: 4 cm after 11 cm"
    if contender.is_baseline:
        show(
            console,
            render_table(
                rows, title + paper, f"{'no' if config.momentum_control else 'with'} eq. 3d"
            ),
        )
        say(console, verdict(rows, config.momentum_control))
    else:
        launch = plan_com_trajectory(
            config.commanded_height, config.com_displacement, config.com_scaling
        )
        acting = f" with {escape(contender.name)}, after {launch.displacement * 100:.3g} cm"
        show(console, render_table(rows, title + acting + paper, "baseline"))
    for file in wrote:
        say(console, f"wrote {file}")


def _draw_paper(arms: Sequence[Arm], options: EvalOptions, progress: Console) -> list[Path]:
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


def _draw_policy(arms: Sequence[Arm], options: EvalOptions, progress: Console) -> list[Path]:
    from icub_jump_env.evaluation.policy_figure import policy_figure

    assert options.plot is not None  # else nothing is to be drawn
    ours, other = (arm.episode for arm in arms)
    return [save_figure(options.plot, "policy.png", policy_figure(options.config, ours, other))]


def nominal_report(arms: Sequence[Arm], seed: int) -> dict[str, Any]:
    """Everything eval.py found, for ``--json``."""
    ours, other = arms
    return {
        "mode": "nominal",
        "command": command(),
        **provenance(ours.config, seed),
        "arms": {
            arm.name: {
                "policy": arm.contender.identity,
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
