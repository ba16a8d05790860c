"""eval.py --compare: policies on the same episodes, pair by pair."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from scipy.stats import binomtest, bootstrap

from icub_jump_env.evaluation.contender import Contender
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.output import say, show, write_json
from icub_jump_env.evaluation.parallel import check_jobs
from icub_jump_env.evaluation.provenance import command, provenance
from icub_jump_env.evaluation.rollout import Episode
from icub_jump_env.evaluation.series import Series, heights, ranges, warn_if_alike
from icub_jump_env.evaluation.statistics import CONFIDENCE, Rate
from icub_jump_env.evaluation.table import CM, DEG

Interval = tuple[float, float]

_RESAMPLES = 9999


@dataclass(frozen=True)
class Summary:
    """What some episodes of one contender say.

    Attributes:
        success: At least 0.7 of the commanded height, and landed.
        landed: Landed and stands.
        rise: Mean flight height (m) of all episodes.
        height_error: Mean distance of the flight height from the command (m).
        rotation: Median size of the rotation in flight (rad); NaN without a flight.
        landing_force: Median of the largest ground force after touch-down (N).
        joint_work: Median mechanical work of the joints (J).
    """

    success: Rate
    landed: Rate
    rise: float
    height_error: float
    rotation: float
    landing_force: float
    joint_work: float

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> Summary:
        """The summary of some episodes."""
        rise = _values(episodes, "flight_height")
        commands = np.array([episode.jump_height for episode in episodes])
        return cls(
            success=Rate(sum(e.is_success for e in episodes), len(episodes)),
            landed=Rate(sum(bool(e.jump["landed"]) for e in episodes), len(episodes)),
            rise=float(rise.mean()),
            height_error=float(np.abs(rise - commands).mean()),
            rotation=_median(np.abs(_values(episodes, "flight_rotation"))),
            landing_force=_median(_values(episodes, "landing_force")),
            joint_work=_median(_values(episodes, "joint_work")),
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "success": self.success.as_dict(),
            "landed": self.landed.as_dict(),
            "mean_rise": self.rise,
            "mean_height_error": self.height_error,
            "median_rotation": self.rotation,
            "median_landing_force": self.landing_force,
            "median_joint_work": self.joint_work,
        }


@dataclass(frozen=True)
class Difference:
    """One contender against another one on the same episodes.

    Attributes:
        won: Episodes that it alone succeeded in.
        lost: Episodes that the other one alone succeeded in.
        p_value: Of McNemar's exact test: how likely won and lost are to differ as much by
            chance.
        success: Gain in the success rate (1 is all episodes).
        success_interval: Its bootstrap interval of 95 %.
        rise: Gain in the mean flight height (m).
        rise_interval: Its bootstrap interval of 95 %.
    """

    won: int
    lost: int
    p_value: float
    success: float
    success_interval: Interval
    rise: float
    rise_interval: Interval

    @classmethod
    def of(cls, ours: Sequence[Episode], theirs: Sequence[Episode]) -> Difference:
        """The difference of two lists with the same seeds in the same order."""
        gains = np.array([o.is_success - t.is_success for o, t in zip(ours, theirs, strict=True)])
        won, lost = int((gains > 0).sum()), int((gains < 0).sum())
        rises = _values(ours, "flight_height") - _values(theirs, "flight_height")
        return cls(
            won=won,
            lost=lost,
            p_value=float(binomtest(won, won + lost).pvalue) if won + lost else 1.0,
            success=float(gains.mean()),
            success_interval=bootstrap_interval(gains),
            rise=float(rises.mean()),
            rise_interval=bootstrap_interval(rises),
        )

    def __str__(self) -> str:
        low, high = (100 * bound for bound in self.success_interval)
        shallow, steep = (CM * bound for bound in self.rise_interval)
        p = "p < 0.001" if self.p_value < 0.001 else f"p = {self.p_value:.3f}"
        return (
            f"success {100 * self.success:+.1f} points (95 % interval {low:+.1f} to {high:+.1f}; "
            f"won {self.won}, lost {self.lost}, McNemar {p}), "
            f"rise {CM * self.rise:+.2f} cm ({shallow:+.2f} to {steep:+.2f})"
        )


def bootstrap_interval(
    values: NDArray[Any], statistic: Callable[..., Any] = np.mean
) -> tuple[float, float]:
    """Percentile bootstrap interval of 95 %, the same at each call."""
    if np.ptp(values) == 0.0:
        return float(values[0]), float(values[0])
    interval = bootstrap(
        (values,),
        statistic,
        n_resamples=_RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)


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
        from icub_jump_env.evaluation.compare_figure import compare_figure

        options.plot.mkdir(parents=True, exist_ok=True)
        file = options.plot / "compare.png"
        compare_figure(episodes).savefig(file)
        say(progress, f"wrote {file}")
    config, seeds = options.config, _seeds(options)
    say(
        console,
        f"{heights(config)} jump, {config.controller} controller, randomization "
        f"{ranges(config)}, seeds {seeds[0]} to {seeds[-1]} for each",
    )
    show(console, render(episodes))
    first, *others = episodes
    for name in others:
        difference = Difference.of(episodes[name], episodes[first])
        say(console, f"{name} against {first}: {difference}")


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


def by_command(episodes: Sequence[Episode]) -> dict[tuple[int, int], list[Episode]]:
    """Episodes by the centimetres that their command lies between, ascending."""

    def centimetre(episode: Episode) -> int:
        return math.floor(CM * episode.jump_height + 1e-9)

    groups = itertools.groupby(sorted(episodes, key=centimetre), key=centimetre)
    return {(low, low + 1): list(group) for low, group in groups}


def command_labels(episodes: Sequence[Episode]) -> dict[tuple[int, int], str]:
    """What to call the groups of :func:`by_command`; a single command by itself."""
    commands = {episode.jump_height for episode in episodes}
    alone = f"{CM * min(commands):g} cm" if len(commands) == 1 else None
    return {(low, high): alone or f"{low} to {high} cm" for low, high in by_command(episodes)}


def report(
    episodes: dict[str, list[Episode]], options: EvalOptions, contenders: Sequence[Contender]
) -> dict[str, Any]:
    """Everything that was found, for ``--json``."""
    first = next(iter(episodes))
    return {
        "mode": "compare",
        "command": command(),
        "episodes": len(episodes[first]),
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
        "differences": {
            name: vars(Difference.of(episodes[name], episodes[first]))
            for name in episodes
            if name != first
        },
    }


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
        for number, (name, series) in enumerate(group.items()):
            last = number == len(group) - 1
            table.add_row(
                label if number == 0 else "", escape(name), *_cells(series), end_section=last
            )
    table.caption = (
        "success: landed after at least 0.7 of the command; rise and distance from the command: "
        "means of all episodes, the rest medians"
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
        f"{CM * summary.rise:.2f}",
        f"{CM * summary.height_error:.2f}",
        f"{DEG * summary.rotation:.1f}",
        f"{summary.landing_force:.0f}",
        f"{summary.joint_work:.0f}",
    ]


def _values(episodes: Sequence[Episode], metric: str) -> NDArray[np.float64]:
    return np.array([float(episode.jump[metric]) for episode in episodes])


def _median(values: NDArray[np.float64]) -> float:
    defined = values[~np.isnan(values)]
    return float(np.median(defined)) if defined.size else math.nan
