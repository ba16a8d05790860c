"""Our jump beside the paper's (section IV), and beside the same jump done otherwise."""

from __future__ import annotations

from dataclasses import dataclass

from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.evaluation.episodes.rollout import Episode, planned
from icub_jump_env.evaluation.quantities import QUANTITIES, SCALE, shown


@dataclass(frozen=True)
class PaperResult:
    """Numbers of the nominal jump, 4 cm at a displacement of 11 cm; SI units.

    Attributes:
        flight_height: CoM rise in flight (simulation, section IV-A).
        sole_height: Largest height of the soles (simulation, section IV-A).
        ballistic_height: CoM rise computed from the take-off speed measured on the
            real robot (section IV-B), which jumped with the velocity controller only.
        takeoff_velocity: Commanded take-off velocity (section IV).
        takeoff_time: Take-off time (section IV, Fig. 2).
    """

    flight_height: float
    sole_height: float
    ballistic_height: float | None
    takeoff_velocity: float = 0.89
    takeoff_time: float = 0.43


PAPER: dict[ControllerName, PaperResult] = {
    "velocity": PaperResult(0.035, 0.037, ballistic_height=0.03),
    "torque": PaperResult(0.016, 0.023, ballistic_height=None),
}

_REAL_ROBOT = "real robot"

SOURCES = {
    "flight_height": "simulation",
    "sole_height": "simulation",
    "takeoff_velocity": "command",
    "takeoff_time": "command",
    "ballistic_height": _REAL_ROBOT,
}
"""Where the paper's values come from, by metric."""


@dataclass(frozen=True)
class Row:
    """One quantity.

    Attributes:
        quantity: What it is.
        unit: Unit of the numbers.
        paper: The paper's value, if it gives one.
        ours: Ours as configured.
        difference: Ours minus the paper's, if both are simulations of the same jump.
        other: That of the jump it is compared with.
        source: Where the paper's value comes from.
    """

    quantity: str
    unit: str
    paper: float | None
    ours: float
    difference: float | None
    other: float
    source: str

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Paper, ours, difference and other; the paper's with the digits that it gives."""
        return (
            "-" if self.paper is None else f"{self.paper:g}",
            shown(self.ours, self.unit),
            shown(self.difference, self.unit, signed=True),
            shown(self.other, self.unit),
        )


def comparison_rows(config: JumpConfig, ours: Episode, other: Episode) -> list[Row]:
    """A row for each quantity.

    Args:
        config: Our configuration. There is a difference to the paper only where it is the
            paper's jump.
        ours: The episode as configured.
        other: The episode it is compared with.
    """
    rows = []
    same_jump = planned(config) == planned(JumpConfig())
    for quantity, metric, unit in QUANTITIES:
        scale, source = SCALE.get(unit, 1.0), SOURCES.get(metric, "")
        value, beside = (scale * float(episode.jump[metric]) for episode in (ours, other))
        paper = getattr(PAPER[config.controller], metric, None)
        reference = None if paper is None else scale * paper
        difference = None
        if reference is not None and same_jump and source != _REAL_ROBOT:
            difference = value - reference
        rows.append(Row(quantity, unit, reference, value, difference, beside, source))
    return rows


def verdict(ours: Episode, other: Episode, momentum_control: bool) -> str:
    """Which arm of the ablation stands, in a sentence; ``other`` has the constraint switched."""
    arms = (ours, other) if momentum_control else (other, ours)
    with_, without = ("stands" if arm.jump["landed"] else "falls" for arm in arms)
    return f"With the momentum constraint (3d) the robot {with_}; without it, it {without}."
