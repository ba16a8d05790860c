"""The table: paper, ours, difference, and the ablation of the momentum constraint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich import box
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.statistics.paper import PAPER
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.reference.com_trajectory import ComTrajectory, plan_com_trajectory


@dataclass(frozen=True)
class Row:
    """One quantity.

    Attributes:
        quantity: What it is.
        unit: Unit of the numbers.
        paper: The paper's value, if it gives one.
        ours: Ours as configured.
        difference: Ours minus the paper's.
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


CM, DEG = 100.0, math.degrees(1.0)

QUANTITIES = (
    ("flight height (CoM)", "flight_height", "cm", CM, "simulation"),
    ("sole height", "sole_height", "cm", CM, "simulation"),
    ("take-off velocity", "takeoff_velocity", "m/s", 1.0, "command"),
    ("take-off time", "takeoff_time", "s", 1.0, "command"),
    ("ballistic height", "ballistic_height", "cm", CM, "real robot"),
    ("rotation in flight", "flight_rotation", "deg", DEG, ""),
    ("base pitch in flight", "base_pitch_range", "deg", DEG, "Fig. 6"),
    ("limit violations", "limit_violations", "steps", 1.0, ""),
    ("landed and stands", "landed", "%", 100.0, "simulation"),
)
"""Quantity, metric and attribute of the paper's result, unit, scale, the paper's source."""


def comparison_rows(config: JumpConfig, ours: Episode, other: Episode) -> list[Row]:
    """The rows of the table.

    Args:
        config: Our configuration. There is a difference to the paper only where it is the
            paper's jump.
        ours: The episode as configured.
        other: The episode it is compared with.

    Returns:
        One row per quantity.
    """
    rows = []
    same_jump = _plan(config) == _plan(JumpConfig())
    for quantity, key, unit, scale, source in QUANTITIES:
        paper = getattr(PAPER[config.controller], key, None)
        value, beside = (scale * float(episode.jump[key]) for episode in (ours, other))
        reference = None if paper is None else scale * paper
        difference = None if reference is None or not same_jump else value - reference
        rows.append(Row(quantity, unit, reference, value, difference, beside, source))
    return rows


def _plan(config: JumpConfig) -> ComTrajectory:
    return plan_com_trajectory(
        config.commanded_height, config.com_displacement, config.com_scaling
    )


def render_table(rows: Sequence[Row], title: str, other: str) -> Table:
    """The table for the terminal; ``other`` names the last column."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for column in ("paper", "ours", "difference", other):
        table.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            f"{row.quantity}, {row.unit}",
            number(row.paper),
            number(row.ours, row.unit),
            number(row.difference, row.unit, signed=True),
            number(row.other, row.unit),
        )
    table.caption = (
        "paper: simulated heights and landing, commanded take-off, ballistic height of the real "
        "robot"
    )
    if "3d" in other:
        table.caption += "; eq. 3d: the momentum constraint"
    table.caption_justify = "left"
    return table


def verdict(rows: Sequence[Row], momentum_control: bool) -> str:
    """Which arm of the ablation stands, in a sentence."""
    row = next(row for row in rows if row.quantity.startswith("landed"))
    with_, without = (
        "stands" if landed else "falls"
        for landed in ((row.ours, row.other) if momentum_control else (row.other, row.ours))
    )
    return f"With the momentum constraint (3d) the robot {with_}; without it, it {without}."


_DECIMALS = {"cm": 2, "m/s": 3, "s": 3, "deg": 1, "N": 0, "J": 0, "steps": 0, "%": 0}


def number(value: float | None, unit: str | None = None, signed: bool = False) -> str:
    """A number of a table, with decimals that suit its unit; a dash where there is none.

    Without a unit it has as many digits as its source gave it.
    """
    if value is None or math.isnan(value):
        return "-"
    digits = "g" if unit is None else f".{_DECIMALS[unit]}f"
    return f"{value:{'+' if signed else ''}{digits}}"
