"""How high whole-body plans go, how high the robot jumps with them, and what binds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import perturbed
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.quantities import CONTROLLERS, number, spread
from icub_jump_env.evaluation.report.output import new_table, show, write_results
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.planning.whole_body.family import PlanFamily

REPETITIONS = 10
"""Jumps with each plan, link masses within 0.1 %; all of them must stand."""


@dataclass(frozen=True)
class Highest:
    """The highest plan with which the robot stands.

    Attributes:
        family: The plans.
        member: Index of the plan that it follows.
        summary: What its repetitions say.
        self_collisions: Largest number of them in a repetition.
    """

    family: PlanFamily
    member: int
    summary: Summary
    self_collisions: float

    @property
    def share(self) -> float:
        """Rise as a share of the physical optimum."""
        return self.summary.median("flight_height") / self.family.optimum

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        plan = self.family.card["plans"][self.member]
        return {
            "plan": plan,
            "optimum": self.family.card["optimum"],
            "share_of_optimum": self.share,
            "self_collisions": self.self_collisions,
            "repeated": self.summary.as_dict(),
        }


def run(options: EvalOptions, _: Sequence[Contender], console: Console, progress: Console) -> None:
    """Run ``eval.py --max-height``."""
    config = options.config
    names = CONTROLLERS if config.plans is None else (config.controller_name,)
    if config.plans is None and config.controller_name != JumpConfig().controller_name:
        allowed = "not with --max-height, which shows both; with --plans, that of the plans"
        raise ConfigError("controller", config.controller_name, allowed)
    found = {
        name: highest_jump(
            config.for_controller(name).replace(planner="whole_body"), options, progress
        )
        for name in names
    }
    write_results(options, progress, {name: best.as_dict() for name, best in found.items()}, {})
    show(console, render(found))
    show(console, render_binding(found))


def highest_jump(config: JumpConfig, options: EvalOptions, progress: Console) -> Highest:
    """The highest plan of a family with which every repetition stands.

    Args:
        config: The jump; its command does not matter.
        options: Seed of the first repetition, and processes.
        progress: Where the progress is shown.

    Raises:
        ConfigError: If there is none.
    """
    family = config.plan_family
    seeds = range(options.seed, options.seed + REPETITIONS)
    for member in reversed(range(len(family.rise))):
        jump = perturbed(config.replace(jump_height=float(family.rise[member])))
        episodes = run_all([Job(jump, seed) for seed in seeds], options.workers, progress)
        if all(episode.landed for episode in episodes):
            return Highest(family, member, Summary.of(episodes), _most_collisions(episodes))
    raise ConfigError("plans", config.plans, "a family with a plan that the robot lands with")


def _most_collisions(episodes: Sequence[Episode]) -> float:
    return float(max(episode.jump["self_collisions"] for episode in episodes))


def render(found: Mapping[ControllerName, Highest]) -> Table:
    """A column for each controller."""
    table = new_table(1, "", *found, title="The highest plan that stands")
    families = [best.family for best in found.values()]
    summaries = [best.summary for best in found.values()]
    plans = [family.card["plans"][-1] for family in families]
    rises = [summary.percentiles["flight_height"] for summary in summaries]
    shares = [best.share for best in found.values()]
    collisions = [best.self_collisions for best in found.values()]

    def medians(metric: str, unit: str) -> Iterator[str]:
        return (number(summary.median(metric), unit) for summary in summaries)

    for name, cells in (
        ("physical optimum, cm", (number(family.optimum, "cm") for family in families)),
        ("highest plan, cm", (number(plan["height"], "cm") for plan in plans)),
        ("rise with the highest plan that stands, cm", medians("flight_height", "cm")),
        ("  10 to 90 %", (spread(low, high, "cm") for low, _, high in rises)),
        ("  of the physical optimum, %", (number(share, "%") for share in shares)),
        ("sole height, cm", medians("sole_height", "cm")),
        ("landed and stands, %", (number(s.landed.share, "%") for s in summaries)),
        ("limit violations, steps", medians("limit_violations", "steps")),
        ("self-collisions, steps", (number(count, "steps") for count in collisions)),
    ):
        table.add_row(name, *cells)
    table.caption = (
        f"{REPETITIONS} jumps with link masses within 0.1 %: medians, but the largest number of "
        "self-collisions; physical optimum: the highest launch within the limits of the robot, "
        "without margins and controller"
    )
    return table


def render_binding(found: Mapping[ControllerName, Highest]) -> Table:
    """What is at its limit in the plans of the highest jumps, and in the physical optimum."""
    optimum = next(iter(found.values())).family.card["optimum"]
    columns: dict[str, Any] = {
        name: best.family.card["plans"][best.member] for name, best in found.items()
    }
    columns["physical optimum"] = optimum
    table = new_table(1, "limit", *columns, title="When a limit is reached, s")
    for limit in dict.fromkeys(limit for plan in columns.values() for limit in plan["binding"]):
        spans = (plan["binding"].get(limit) for plan in columns.values())
        table.add_row(limit, *("-" if s is None else f"{s[0]:.2f} to {s[1]:.2f}" for s in spans))
    table.caption = "first and last time in the launch; in the plans, limits less their margins"
    return table
