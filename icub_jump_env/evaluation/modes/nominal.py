"""The default mode of eval.py: one jump beside the paper's, and beside another one.

The other one is the jump without the momentum constraint; of a policy, the baseline.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender
from icub_jump_env.evaluation.episodes.rollout import (
    Episode,
    make_env,
    planned,
    run_episode,
    traced,
)
from icub_jump_env.evaluation.episodes.series import perturbed
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.quantities import CM, commands
from icub_jump_env.evaluation.report.output import (
    new_table,
    progress_display,
    say,
    show,
    write_results,
)
from icub_jump_env.evaluation.statistics.paper import (
    MOMENTUM_EQUATION,
    Row,
    comparison_rows,
    verdict,
)
from icub_jump_env.evaluation.statistics.summary import Summary, landed_in_a_row

if TYPE_CHECKING:
    from icub_jump_env.evaluation.figures.style import Figure


REPETITIONS = 10


@dataclass(frozen=True)
class Arm:
    """One of the two jumps.

    Attributes:
        name: Its name.
        config: The jump.
        contender: What acts.
        episode: The jump as asked for.
        repeated: The same with slightly different link masses: what one episode is worth.
    """

    name: str
    config: JumpConfig
    contender: Contender
    episode: Episode
    repeated: tuple[Episode, ...]


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
        switched = config.replace(momentum_control=not _constrained(config))
        jumps = [
            ("with" if _constrained(c) else "without", c, contender) for c in (config, switched)
        ]
    else:
        jumps = [("policy", config, contender), ("baseline", config, BASELINE)]
    arms = []
    with progress_display(console) as progress:
        task = progress.add_task("jumping", total=2 * (1 + REPETITIONS))
        for name, arm_config, acting in jumps:
            hold = arm_config.controls_per_step if trace else 1
            with contextlib.closing(make_env(traced(arm_config) if trace else arm_config)) as env:
                episode = run_episode(env, seed, acting.policy, trace, hold=hold)
            progress.advance(task)
            repeated = []
            with contextlib.closing(make_env(perturbed(arm_config))) as env:
                for other_seed in range(seed, seed + REPETITIONS):
                    repeated.append(run_episode(env, other_seed, acting.policy))
                    progress.advance(task)
            arms.append(Arm(name, arm_config, acting, episode, tuple(repeated)))
    return arms[0], arms[1]


def _constrained(config: JumpConfig) -> bool:
    return config.controller_config.momentum_control


def run(
    options: EvalOptions, contenders: Sequence[Contender], console: Console, progress: Console
) -> None:
    """Run eval.py without a mode."""
    config, (contender, *_) = options.config, contenders
    if options.plot is not None and contender.is_baseline:
        from icub_jump_env.evaluation.figures.paper import realistic

        realistic(config)  # refuses before any work what Fig. 4 cannot be drawn of
    arms = run_nominal(config, options.seed, options.plot is not None, progress, contender)
    ours, other = arms
    rows = comparison_rows(config, ours.repeated, other.repeated)
    write_results(options, progress, report(arms, rows), _figures(arms, options))
    title = f"{commands(*config.jump_heights)} jump, {config.controller_name} controller"
    if contender.is_baseline:
        equation = MOMENTUM_EQUATION[config.controller_name]
        column = f"{'no' if _constrained(config) else 'with'} eq. {equation}"
    else:
        launch = f"{CM * planned(config).displacement:.3g} cm"
        title, column = f"{title} with {escape(contender.name)}, after {launch}", "baseline"
    show(console, render_table(rows, f"{title}; the paper's: 4 cm after 11 cm", column))
    if contender.is_baseline:
        say(console, verdict(config, ours.episode, other.episode))
    if config.jumps > 1:
        say(console, landed_in_a_row(ours.repeated, config.jumps))


def _figures(arms: Sequence[Arm], options: EvalOptions) -> dict[str, Callable[[], Figure]]:
    """What draws the paper's figures; of a policy, what it does."""
    if options.plot is None:
        return {}
    config, ours, other = options.config, *(arm.episode for arm in arms)
    if not arms[0].contender.is_baseline:
        from icub_jump_env.evaluation.figures.policy import policy_figure

        return {"policy.png": partial(policy_figure, config, ours, other)}
    from icub_jump_env.evaluation.figures.paper import paper_figures
    from icub_jump_env.evaluation.figures.snapshots import snapshot_strip

    return {
        **paper_figures(config, {arm.name: arm.episode for arm in arms}, options.seed),
        "fig5_snapshots.png": partial(snapshot_strip, config, ours),
    }


def render_table(rows: Sequence[Row], title: str, other: str) -> Table:
    """The table for the terminal; ``other`` names the last column."""
    table = new_table(1, "", "paper", "ours", "10 to 90 %", "difference", other, title=title)
    for row in rows:
        table.add_row(f"{row.quantity}, {row.unit}", *row.cells)
    table.caption = (
        "paper: simulated heights, commanded take-off, ballistic height of the real robot; "
        f"the others: medians of {REPETITIONS} jumps with link masses within 0.1 %"
    )
    if "eq." in other:
        table.caption += f"; {other[-6:]}: the momentum constraint"
    return table


def report(arms: Sequence[Arm], rows: Sequence[Row]) -> dict[str, Any]:
    """Everything eval.py found, for ``--json``."""
    return {
        "arms": {
            arm.name: {
                "policy": arm.contender.identity,
                "momentum_control": _constrained(arm.config),
                "outcome": arm.episode.outcome,
                "is_success": arm.episode.is_success,
                "failure": arm.episode.failure,
                "jump": arm.episode.jump,
                "repeated": Summary.of(arm.repeated).as_dict(),
            }
            for arm in arms
        },
        "comparison": [dataclasses.asdict(row) for row in rows],
    }
