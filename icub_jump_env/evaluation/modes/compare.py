"""eval.py --compare: policies on the same episodes, pair by pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.statistics.difference import Difference
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.report.output import save_figure, say, show, write_json
from icub_jump_env.evaluation.episodes.parallel import check_jobs
from icub_jump_env.evaluation.report.provenance import command, provenance
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series, heights, ranges, warn_if_alike
from icub_jump_env.evaluation.statistics.summary import Summary, by_command, command_labels
from icub_jump_env.evaluation.quantities import CM, DEG, number


def run_compare(
    options: EvalOptions, contenders: Sequence[Contender], console: Console, progress: Console
) -> None:
    """Run ``eval.py --compare``."""
    check_jobs(options.jobs)
    warn_if_alike(options.config, progress)
    episodes = run_contenders(options, contenders, progress)
    if options.json is not None:
        write_json(options.json, report(episodes, options, contenders))
        say(progress, f"wrote {options.json}")
    if options.plot is not None:
        from icub_jump_env.evaluation.figures.compare import compare_figure

        file = save_figure(options.plot, "compare.png", compare_figure(episodes))
        say(progress, f"wrote {file}")
    config, seeds = options.config, _seeds(options)
    say(
        console,
        f"{heights(config)} jump, {config.controller} controller, randomization "
        f"{ranges(config)}, seeds {seeds[0]} to {seeds[-1]} for each",
    )
    show(console, render(episodes))
    for name, done in episodes.items():
        failures = Summary.of(done).failures.items()
        counts = ", ".join(f"{len(seeds)} {kind}" for kind, seeds in failures)
        say(console, f"{name} failed: {counts or 'never'}")
    for ours, theirs in _pairs(contenders):
        difference = Difference.of(episodes[ours], episodes[theirs])
        say(console, f"{ours} against {theirs}: {difference}")


def _pairs(contenders: Sequence[Contender]) -> list[tuple[str, str]]:
    """Names: all against the first, and the last against those between."""
    first, *others = (contender.name for contender in contenders)
    return [(name, first) for name in others] + [(others[-1], name) for name in others[:-1]]


def run_contenders(
    options: EvalOptions, contenders: Sequence[Contender], progress: Console
) -> dict[str, list[Episode]]:
    """The episodes of each contender, by its name."""
    episodes = {}
    for contender in contenders:
        series = Series(options.config, _seeds(options), contender)
        log = series.default_log()
        resume = options.resume and log.exists()
        episodes[contender.name] = series.run(log, resume, options.jobs, progress)
    return episodes


def _seeds(options: EvalOptions) -> range:
    return range(options.seed, options.seed + (options.episodes or 1))


def report(
    episodes: dict[str, list[Episode]], options: EvalOptions, contenders: Sequence[Contender]
) -> dict[str, Any]:
    """Everything that was found, for ``--json``."""
    return {
        "mode": "compare",
        "command": command(),
        "episodes": options.episodes or 1,
        **provenance(options.config, options.seed),
        "contenders": {
            contender.name: {
                **contender.identity,
                "all": Summary.of(episodes[contender.name]).as_dict(),
                "by_command": [
                    {"jump_height": (low / CM, high / CM), **Summary.of(group).as_dict()}
                    for (low, high), group in by_command(episodes[contender.name]).items()
                ],
            }
            for contender in contenders
        },
        "differences": [
            {
                "ours": ours,
                "theirs": theirs,
                "all": vars(Difference.of(episodes[ours], episodes[theirs])),
                "by_command": _differences_by_command(episodes[ours], episodes[theirs]),
            }
            for ours, theirs in _pairs(contenders)
        ],
    }


def _differences_by_command(
    ours: Sequence[Episode], theirs: Sequence[Episode]
) -> list[dict[str, Any]]:
    groups = zip(by_command(ours).items(), by_command(theirs).values(), strict=True)
    return [
        {"jump_height": (low / CM, high / CM), **vars(Difference.of(our_group, their_group))}
        for ((low, high), our_group), their_group in groups
    ]


def render(episodes: dict[str, list[Episode]]) -> Table:
    """The table for the terminal: one row per command range and contender."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in ("command", "policy"):
        table.add_column(column, no_wrap=True)
    for column in (
        "success",
        "95 % interval",
        "landed",
        "rise, cm",
        "soles, cm",
        "off by, cm",
        "rotation, deg",
        "landing, N",
        "work, J",
    ):
        table.add_column(column, justify="right", no_wrap=True)
    grouped = {name: by_command(series) for name, series in episodes.items()}
    labels = command_labels(next(iter(episodes.values())))
    rows = [
        (label, {name: groups[command] for name, groups in grouped.items()})
        for command, label in labels.items()
    ]
    if len(rows) > 1:
        rows.append(("all", episodes))
    for label, group in rows:
        for row, (name, series) in enumerate(group.items()):
            last = row == len(group) - 1
            table.add_row(
                label if row == 0 else "", escape(name), *_cells(series), end_section=last
            )
    table.caption = (
        "success: landed after at least 0.7 of the command; rise of the CoM, height of the soles "
        "and distance from the command: means of all episodes, the rest medians"
    )
    table.caption_justify = "left"
    return table


def _cells(episodes: Sequence[Episode]) -> list[str]:
    summary = Summary.of(episodes)
    low, high = summary.success.interval
    return [
        f"{100 * summary.success.share:.1f} %",
        f"{100 * low:.1f} to {100 * high:.1f}",
        f"{100 * summary.landed.share:.1f} %",
        number(CM * summary.mean_rise, "cm"),
        number(CM * summary.mean_sole_height, "cm"),
        number(CM * summary.mean_height_error, "cm"),
        number(DEG * summary.median_rotation, "deg"),
        number(summary.median("landing_force"), "N"),
        number(summary.median("joint_work"), "J"),
    ]
