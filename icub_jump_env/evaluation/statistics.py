"""Many episodes: how often the jump succeeds, how well, and why it fails."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.contender import Contender
from icub_jump_env.evaluation.failures import Failure
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.output import (
    say,
    show,
    strict_json,
    write_json,
)
from icub_jump_env.evaluation.parallel import check_jobs
from icub_jump_env.evaluation.provenance import command, provenance
from icub_jump_env.evaluation.rollout import Episode
from icub_jump_env.evaluation.series import Series, heights, ranges, warn_if_alike
from icub_jump_env.evaluation.table import CM, QUANTITIES, number

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Rate:
    """A share of episodes with its Wilson interval."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """Observed share."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson interval of 95 %."""
        interval = binomtest(self.count, self.total).proportion_ci(CONFIDENCE, method="wilson")
        return float(interval.low), float(interval.high)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"count": self.count, "total": self.total, "interval": self.interval}

    def __str__(self) -> str:
        low, high = self.interval
        return (
            f"{100 * self.share:.1f} % ({self.count} of {self.total}; "
            f"95 % interval {100 * low:.1f} to {100 * high:.1f} %)"
        )


@dataclass(frozen=True)
class Statistics:
    """What a set of episodes says.

    Attributes:
        success: At least 0.7 of the commanded height, and landed.
        landed: Landed and stands.
        mean_rise: Mean flight height of all episodes (m).
        percentiles: 10th, 50th and 90th percentile of each metric, SI units, over the
            episodes where it is defined; NaN if there is none.
        failures: Seeds of the failed episodes by class.
    """

    success: Rate
    landed: Rate
    mean_rise: float
    percentiles: Mapping[str, tuple[float, float, float]]
    failures: Mapping[Failure, tuple[int, ...]]

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> Statistics:
        """Statistics of some episodes, in any order."""
        total = len(episodes)
        failures = {
            kind: tuple(sorted(e.seed for e in episodes if e.failure is kind)) for kind in Failure
        }
        percentiles = {}
        for _, metric, *_ in QUANTITIES:
            values = np.array([float(e.jump[metric]) for e in episodes])
            values = values[~np.isnan(values)]
            p10, p50, p90 = np.percentile(values, [10, 50, 90]) if values.size else [np.nan] * 3
            percentiles[metric] = (float(p10), float(p50), float(p90))
        return cls(
            success=Rate(sum(e.is_success for e in episodes), total),
            landed=Rate(sum(bool(e.jump["landed"]) for e in episodes), total),
            mean_rise=float(np.mean(sorted(e.jump["flight_height"] for e in episodes))),
            percentiles=percentiles,
            failures={kind: seeds for kind, seeds in failures.items() if seeds},
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "success": self.success.as_dict(),
            "landed": self.landed.as_dict(),
            "mean_rise": self.mean_rise,
            "percentiles": self.percentiles,
            "failures": self.failures,
        }


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
            asked | provenance(config, options.seed) | Statistics.of(done).as_dict(),
        )
        say(progress, f"wrote {options.json}")
    if options.plot is not None:
        from icub_jump_env.evaluation.statistics_figure import statistics_figure

        options.plot.mkdir(parents=True, exist_ok=True)
        file = options.plot / "statistics.png"
        statistics_figure(done).savefig(file)
        say(progress, f"wrote {file}")
    title, table, lines = render(done, options, contender)
    say(console, title)
    show(console, table)
    say(console, lines)


def render(
    episodes: Sequence[Episode], options: EvalOptions, contender: Contender
) -> tuple[str, Table, str]:
    """What the terminal shows: title, metrics, rates and failures."""
    config, statistics = options.config, Statistics.of(episodes)
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
            values = (number(scale * value, unit) for value in statistics.percentiles[metric])
            table.add_row(f"{name}, {unit}", *values)
    lines = [
        f"landed and stands: {statistics.landed}",
        f"mean rise: {number(CM * statistics.mean_rise, 'cm')} cm",
        f"success: {statistics.success}",
    ]
    for kind, seeds in statistics.failures.items():
        shown = ", ".join(map(str, seeds[:10])) + (", ..." if len(seeds) > 10 else "")
        lines.append(f"{kind}: {len(seeds)} (seeds {shown})")
    failed = [
        episode for kind in statistics.failures for episode in episodes if episode.failure is kind
    ]
    if failed:
        # In the range of commands it drew this one.
        jump = dataclasses.replace(config, jump_height=failed[0].jump_height)
        words = replay_arguments(jump, failed[0].seed)
        if options.policy is not None:
            words += f" --policy {shlex.quote(str(options.policy))}"
        lines.append(f"replay one: python eval.py {words} --view")
    return title, table, "\n".join(lines)


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
