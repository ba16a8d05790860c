"""What results are called, in which unit they are shown, and with how many decimals."""

from __future__ import annotations

import math
from typing import get_args

from icub_jump_env.control.config import ControllerName

CONTROLLERS: tuple[ControllerName, ...] = get_args(ControllerName)

CM, DEG, PERCENT = 100.0, math.degrees(1.0), 100.0
"""Centimetres in a metre, degrees in a radian, percents in the whole."""

SCALE = {"cm": CM, "deg": DEG, "%": PERCENT}
"""What a value in SI units is multiplied by, where a unit is not itself of the SI."""

_DECIMALS = {"cm": 2, "m/s": 3, "s": 3, "deg": 1, "N": 0, "J": 0, "steps": 0, "%": 0}

QUANTITIES = (
    ("flight height (CoM)", "flight_height", "cm"),
    ("sole height", "sole_height", "cm"),
    ("take-off velocity", "takeoff_velocity", "m/s"),
    ("take-off time", "takeoff_time", "s"),
    ("ballistic height", "ballistic_height", "cm"),
    ("rotation in flight", "flight_rotation", "deg"),
    ("base pitch in flight", "base_pitch_range", "deg"),
    ("limit violations", "limit_violations", "steps"),
    ("landed and stands", "landed", "%"),
)
"""Name, metric and unit of what tables show of a jump."""


def number(value: float | None, unit: str, signed: bool = False) -> str:
    """A value in SI units as a number of a unit; a dash where there is none."""
    return shown(None if value is None else value * SCALE.get(unit, 1.0), unit, signed)


def shown(value: float | None, unit: str, signed: bool = False) -> str:
    """The same of a value that is in this unit already, with decimals that suit it."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:{'+' if signed else ''}z.{_DECIMALS[unit]}f}"


def spread(low: float, high: float, unit: str, signed: bool = False) -> str:
    """An interval as :func:`number` writes its ends."""
    return f"{number(low, unit, signed)} to {number(high, unit, signed)}"


def probability(p: float) -> str:
    """A p-value."""
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def commands(low: float, high: float) -> str:
    """A command (m), or a range of them, in centimetres."""
    return f"{CM * low:g} cm" if low == high else f"{CM * low:g} to {CM * high:g} cm"


def seeds(used: range) -> str:
    """The seeds of a series, for titles."""
    return f"seed {used[0]}" if len(used) == 1 else f"seeds {used[0]} to {used[-1]}"
