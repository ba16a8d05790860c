"""eval.py --compare: policies on the same episodes, pair by pair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series, warn_if_alike, world
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.quantities import PERCENT, commands, number, seeds
from icub_jump_env.evaluation.report.output import new_table, say, show, write_results
from icub_jump_env.evaluation.statistics.difference import (
    Difference,
    holm_corrected,
    in_words,
)
from icub_jump_env.evaluation.statistics.summary import Summary, by_command, command_labels

if TYPE_CHECKING:
    from icub_jump_env.evaluation.figures.style import Figure

Arms = Mapping[str, Sequence[Episode]]
"""Episodes by the name of their contender."""

Differences = Mapping[tuple[str, str], Difference]
"""What one contender gains over another one, by their names."""


def run(
    options: EvalOptions, contenders: Sequence[Contender], console: Console, progress: Console
) -> None:
    """Run ``eval.py --compare``."""
    config = options.config
    if options.episodes is None and min(config.jump_heights) < max(config.jump_heights):
        # A policy's card may bring the range: one episode is not what was asked for.
        drawn = commands(*config.jump_heights)
        raise ConfigError("episodes", None, f"a number: each draws its command of {drawn}")
    warn_if_alike(config, progress)
    arms = run_contenders(options, contenders, progress)
    differences = _differences(arms, contenders)
    found = report(arms, contenders, differences) | {"episodes": len(options.seeds)}

    def figure() -> Figure:
        from icub_jump_env.evaluation.figures.compare import compare_figure

        return compare_figure(arms, options.config.success)

    write_results(options, progress, found, {"compare.png": figure})
    say(
        console,
        f"{commands(*config.jump_heights)} jump, {config.controller_name} controller, randomization "
        f"{world(config)}, {seeds(options.seeds)} for each",
    )
    show(console, render(arms))
    for name, episodes in arms.items():
        failures = Summary.of(episodes).failures.items()
        counts = ", ".join(f"{len(failed)} {kind}" for kind, failed in failures)
        say(console, f"{name} failed: {counts or 'never'}")
    named = {f"{ours} against {theirs}": found for (ours, theirs), found in differences.items()}
    for line in in_words(named):
        say(console, line)


def _differences(arms: Arms, contenders: Sequence[Contender]) -> Differences:
    """All against the first, and the last against those between, corrected for their number."""
    first, *others = (contender.name for contender in contenders)
    pairs = [(name, first) for name in others] + [(others[-1], name) for name in others[:-1]]
    found = holm_corrected([Difference.of(arms[ours], arms[theirs]) for ours, theirs in pairs])
    return dict(zip(pairs, found, strict=True))


def run_contenders(
    options: EvalOptions, contenders: Sequence[Contender], progress: Console
) -> dict[str, list[Episode]]:
    """The episodes of each contender, by its name."""
    arms = {}
    for contender in contenders:
        series = Series(options.config, options.seeds, contender)
        log = series.default_log()
        arms[contender.name] = series.run(log, options.resume, options.workers, progress)
    return arms


def report(
    arms: Arms, contenders: Sequence[Contender], differences: Differences
) -> dict[str, Any]:
    """Everything that was found, for ``--json``."""
    return {
        "contenders": {
            contender.name: {
                **contender.identity,
                "all": Summary.of(arms[contender.name]).as_dict(),
                "by_command": [
                    {"jump_height": command, **Summary.of(group).as_dict()}
                    for command, group in by_command(arms[contender.name]).items()
                ],
            }
            for contender in contenders
        },
        "differences": [
            {
                "ours": ours,
                "theirs": theirs,
                "all": vars(difference),
                "by_command": _differences_by_command(arms[ours], arms[theirs]),
            }
            for (ours, theirs), difference in differences.items()
        ],
    }


def _differences_by_command(
    ours: Sequence[Episode], theirs: Sequence[Episode]
) -> list[dict[str, Any]]:
    groups = zip(by_command(ours).items(), by_command(theirs).values(), strict=True)
    return [
        {"jump_height": command, **vars(Difference.of(our_group, their_group))}
        for (command, our_group), their_group in groups
    ]


def render(arms: Arms) -> Table:
    """The table for the terminal: one row per command range and contender."""
    table = new_table(
        2, "command", "policy", "success", "95 % interval", "landed", "rise, cm", "soles, cm",
        "off by, cm", "rotation, deg", "landing, N", "work, J",
    )  # fmt: skip
    grouped = {name: by_command(episodes) for name, episodes in arms.items()}
    rows: list[tuple[str, Arms]] = [
        (label, {name: groups[command] for name, groups in grouped.items()})
        for command, label in command_labels(next(iter(arms.values()))).items()
    ]
    if len(rows) > 1:
        rows.append(("all", arms))
    for label, group in rows:
        for row, (name, episodes) in enumerate(group.items()):
            last = row == len(group) - 1
            table.add_row(
                label if row == 0 else "", escape(name), *_cells(episodes), end_section=last
            )
    table.caption = (
        "success: landed after at least 0.7 of the command; rise of the CoM, height of the soles "
        "and distance from the command: means of all episodes, the rest medians"
    )
    return table


def _cells(episodes: Sequence[Episode]) -> list[str]:
    summary = Summary.of(episodes)
    return [
        f"{PERCENT * summary.success.share:.1f} %",
        summary.success.bounds,
        f"{PERCENT * summary.landed.share:.1f} %",
        number(summary.mean_rise, "cm"),
        number(summary.mean_sole_height, "cm"),
        number(summary.mean_height_error, "cm"),
        number(summary.median_rotation, "deg"),
        number(summary.median("landing_force"), "N"),
        number(summary.median("joint_work"), "J"),
    ]
