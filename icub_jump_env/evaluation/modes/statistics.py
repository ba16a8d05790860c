"""Many episodes: how often the jump succeeds, how well, and why it fails."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series, warn_if_alike, world
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.quantities import QUANTITIES, commands, number, seeds
from icub_jump_env.evaluation.report.output import new_table, say, show, write_results
from icub_jump_env.evaluation.statistics.summary import Summary, landed_in_a_row
from icub_jump_env.files import strict_json

if TYPE_CHECKING:
    from icub_jump_env.evaluation.figures.style import Figure


def run(
    options: EvalOptions, contenders: Sequence[Contender], console: Console, progress: Console
) -> None:
    """Run eval.py with several episodes or a randomised world."""
    contender = contenders[0]
    warn_if_alike(options.config, progress)
    series = Series(options.config, options.seeds, contender)
    log = options.results or series.default_log()
    episodes = series.run(log, options.resume, options.workers, progress)
    asked = {"episodes": len(episodes), "policy": contender.identity}
    found = asked | Summary.of(episodes).as_dict()

    def figure() -> Figure:
        from icub_jump_env.evaluation.figures.statistics import statistics_figure

        return statistics_figure(episodes, options.config.success)

    write_results(options, progress, found, {"statistics.png": figure})
    title, table, lines = render(episodes, options, contender)
    say(console, title)
    show(console, table)
    for line in lines:
        say(console, line)


def render(
    episodes: Sequence[Episode], options: EvalOptions, contender: Contender
) -> tuple[str, Table, list[str]]:
    """What the terminal shows: title, metrics, rates and failures.

    Of a single episode there is nothing but its values.
    """
    config, summary = options.config, Summary.of(episodes)
    title = (
        f"{commands(*config.jump_heights)} jump, {config.controller_name} controller, "
        f"{contender.name}, randomization {world(config)}, {seeds(options.seeds)}"
    )
    several = len(episodes) > 1
    table = new_table(1, "", *(("10 %", "median", "90 %") if several else ("value",)))
    for name, metric, unit in QUANTITIES:
        if metric != "landed":
            low, middle, high = (number(value, unit) for value in summary.percentiles[metric])
            table.add_row(f"{name}, {unit}", *((low, middle, high) if several else (middle,)))
    lines = [f"landed and stands: {summary.landed}"]
    if several:
        lines.append(f"mean rise: {number(summary.mean_rise, 'cm')} cm")
    lines.append(f"success: {summary.success}")
    if config.jumps > 1:
        lines.append(landed_in_a_row(episodes, config.jumps))
    for kind, failed in summary.failures.items():
        shown = ", ".join(map(str, failed[:10])) + (", ..." if len(failed) > 10 else "")
        lines.append(f"{kind}: {len(failed)} (seeds {shown})" if several else f"failure: {kind}")
    failures = [e for kind in summary.failures for e in episodes if e.failure is kind]
    # What a longer series drew for each jump no flag can say.
    if failures and (config.jumps == 1 or isinstance(config.jump_height, float)):
        # In the range of commands it drew this one.
        jump = dataclasses.replace(config, jump_height=failures[0].jump_height)
        words = replay_arguments(jump, failures[0].seed)
        if options.policy is not None:
            words += f" --policy {shlex.quote(str(options.policy))}"
        lines.append(f"replay one: python eval.py {words} --view")
    return title, table, lines


def replay_arguments(config: JumpConfig, seed: int) -> str:
    """Arguments of eval.py that play one episode again."""
    return shlex.join([*_flags(config, JumpConfig()), "--seed", str(seed)])


def _flags(config: Any, default: Any, prefix: str = "--") -> list[str]:
    """Flags for what differs between two dataclasses of one kind; of a model by name, JSON."""
    words: list[str] = []
    for field in dataclasses.fields(config):
        value, usual = getattr(config, field.name), getattr(default, field.name)
        if value == usual:
            continue
        flag = prefix + field.name.replace("_", "-")
        if isinstance(value, bool):
            words.append(flag if value else flag.replace("--", "--no-", 1))
        elif dataclasses.is_dataclass(value) and type(value) is type(usual):
            words += _flags(value, usual, f"{flag}.")
        elif dataclasses.is_dataclass(value) and not isinstance(value, type):
            words += [flag, strict_json(dataclasses.asdict(value))]
        else:
            words += [flag, *map(str, value if isinstance(value, tuple) else (value,))]
    return words
