"""Our jump beside the paper's (section IV), and beside the same jump done otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import QUANTITIES, SCALE, shown
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.planning.scaled_curve import plan_com_trajectory

_COMMANDED = {"takeoff_velocity": 0.89, "takeoff_time": 0.43}

PAPER: dict[ControllerName, dict[str, float]] = {
    "velocity": {
        "flight_height": 0.035, "sole_height": 0.037, "ballistic_height": 0.03, **_COMMANDED,
    },
    "torque": {"flight_height": 0.016, "sole_height": 0.023, **_COMMANDED},
}  # fmt: skip
"""The paper's numbers of the nominal jump, 4 cm at a displacement of 11 cm, by metric; SI units.

Heights are those of the simulation (section IV-A), take-off velocity and time those commanded
(section IV, Fig. 2). The ballistic height was computed from the take-off speed measured on the
real robot (section IV-B), which jumped with the velocity controller only.
"""

MOMENTUM_EQUATION: dict[ControllerName, str] = {"velocity": "3d", "torque": "6d"}
"""The equation of the constraint on the angular momentum."""

SOURCES = {
    "flight_height": "simulation",
    "sole_height": "simulation",
    "takeoff_velocity": "command",
    "takeoff_time": "command",
    "ballistic_height": "real robot",
}
"""Where they come from."""


@dataclass(frozen=True)
class Row:
    """One quantity.

    Attributes:
        quantity: What it is.
        unit: Unit of the numbers.
        paper: The paper's value, if it gives one.
        ours: Median of ours as configured; of landings, the share.
        spread: 10th and 90th percentile.
        difference: Ours minus the paper's, if both are simulations of the same jump.
        other: As ``ours``, of the jump it is compared with.
        source: Where the paper's value comes from.
    """

    quantity: str
    unit: str
    paper: float | None
    ours: float
    spread: tuple[float, float]
    difference: float | None
    other: float
    source: str

    @property
    def cells(self) -> tuple[str, ...]:
        """Paper, ours, spread, difference, other; the paper's with the digits that it gives."""
        low, high = (shown(bound, self.unit) for bound in self.spread)
        return (
            "-" if self.paper is None else f"{self.paper:g}",
            shown(self.ours, self.unit),
            low if low == high else f"{low} to {high}",
            shown(self.difference, self.unit, signed=True),
            shown(self.other, self.unit),
        )


def comparison_rows(
    config: JumpConfig, ours: Sequence[Episode], other: Sequence[Episode]
) -> list[Row]:
    """A row for each quantity.

    Args:
        config: Our configuration. There is a difference to the paper only where it is the
            paper's jump.
        ours: Episodes as configured.
        other: Episodes they are compared with.
    """
    rows = []
    same_jump = _is_the_papers(config)
    summaries = [Summary.of(episodes) for episodes in (ours, other)]
    for quantity, metric, unit in QUANTITIES:
        scale, source = SCALE.get(unit, 1.0), SOURCES.get(metric, "")
        low, value, high = (scale * bound for bound in summaries[0].percentiles[metric])
        beside = scale * summaries[1].median(metric)
        if metric == "landed":
            value, beside = (scale * summary.landed.share for summary in summaries)
            low = high = value
        paper = PAPER[config.controller_name].get(metric)
        reference = None if paper is None else scale * paper
        difference = None
        if reference is not None and same_jump and source != "real robot":
            difference = value - reference
        rows.append(Row(quantity, unit, reference, value, (low, high), difference, beside, source))
    return rows


def verdict(config: JumpConfig, ours: Episode, other: Episode) -> str:
    """Which arm of the ablation stands, in a sentence; ``other`` has the constraint switched."""
    arms = (ours, other) if config.controller_config.momentum_control else (other, ours)
    with_, without = ("stands" if arm.jump["landed"] else "falls" for arm in arms)
    constraint = f"momentum constraint ({MOMENTUM_EQUATION[config.controller_name]})"
    if with_ == without:
        return f"The robot {with_} with the {constraint} and without it."
    return f"With the {constraint} the robot {with_}; without it, it {without}."


def _is_the_papers(config: JumpConfig) -> bool:
    """Whether a configuration commands the paper's CoM trajectory."""
    if config.planner != "scaled_curve":
        return False
    ours, papers = (
        plan_com_trajectory(jump.commanded_height, jump.com_displacement, jump.com_scaling)
        for jump in (config, JumpConfig())
    )
    return ours == papers
