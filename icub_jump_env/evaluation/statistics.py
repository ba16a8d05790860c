"""Many episodes: how often the jump succeeds, how well, and why it fails."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.contender import Contender
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.output import save_figure, say, show, write_json
from icub_jump_env.evaluation.parallel import check_jobs
from icub_jump_env.evaluation.provenance import command, provenance
from icub_jump_env.evaluation.rollout import Episode
from icub_jump_env.evaluation.series import Series, heights, ranges, warn_if_alike
from icub_jump_env.evaluation.summary import Summary
from icub_jump_env.evaluation.table import CM, QUANTITIES, number
from icub_jump_env.files import strict_json


def run_statistics(
    options: EvalOptions, contender: Contender, console: Console, progress: Console
) -> None:
    """Run eval.py with several episodes or a randomised world."""
    config, episodes = options.config, options.episodes or 1
    check_jobs(options.jobs)
    warn_if_alike(config, progress)
    series = Series(config, range(options.seed, options.seed + episodes), contender)
    done = series.run(
        options.results or series.default_log(), options.resume, options.jobs, progress
    )
    if options.json is not None:
        asked = {
            "mode": "statistics",
            "command": command(),
            "episodes": episodes,
            "policy": contender.identity,
        }
        write_json(
            options.json,
            asked | provenance(config, options.seed) | Summary.of(done).as_dict(),
        )
        say(progress, f"wrote {options.json}")
    if options.plot is not None:
        from icub_jump_env.evaluation.statistics_figure import statistics_figure

        file = save_figure(options.plot, "statistics.png", statistics_figure(done))
        say(progress, f"wrote {file}")
    title, table, lines = render(done, options, contender)
    say(console, title)
    show(console, table)
    for line in lines:
        say(console, line)


def render(
    episodes: Sequence[Episode], options: EvalOptions, contender: Contender
) -> tuple[str, Table, list[str]]:
    """What the terminal shows: title, metrics, rates and failures."""
    config, summary = options.config, Summary.of(episodes)
    title = (
        f"{heights(config)} jump, {config.controller} controller, {contender.name}, "
        f"randomization {ranges(config)}, seeds {options.seed} to "
        f"{options.seed + len(episodes) - 1}"
    )
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for column in ("10 %", "median", "90 %"):
        table.add_column(column, justify="right", no_wrap=True)
    for name, metric, unit, scale, _ in QUANTITIES:
        if metric != "landed":
            values = (number(scale * value, unit) for value in summary.percentiles[metric])
            table.add_row(f"{name}, {unit}", *values)
    lines = [
        f"landed and stands: {summary.landed}",
        f"mean rise: {number(CM * summary.mean_rise, 'cm')} cm",
        f"success: {summary.success}",
    ]
    for kind, seeds in summary.failures.items():
        shown = ", ".join(map(str, seeds[:10])) + (", ..." if len(seeds) > 10 else "")
        lines.append(f"{kind}: {len(seeds)} (seeds {shown})")
    failed = [
        episode for kind in summary.failures for episode in episodes if episode.failure is kind
    ]
    if failed:
        # In the range of commands it drew this one.
        jump = dataclasses.replace(config, jump_height=failed[0].jump_height)
        words = replay_arguments(jump, failed[0].seed)
        if options.policy is not None:
            words += f" --policy {shlex.quote(str(options.policy))}"
        lines.append(f"replay one: python eval.py {words} --view")
    return title, table, lines


def replay_arguments(config: JumpConfig, seed: int) -> str:
    """Arguments of eval.py that play one episode again."""
    words = []
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if value == field.default:
            continue
        flag = field.name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{flag}" if value else f"--no-{flag}")
            continue
        words.append(f"--{flag}")
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            words.append(strict_json(dataclasses.asdict(value)))
        elif isinstance(value, tuple):
            words += map(str, value)
        else:
            words.append(str(value))
    return shlex.join([*words, "--seed", str(seed)])
