"""Why a jump failed, in one word."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from icub_jump_env.metrics.jump import SuccessConfig

OVER_ROTATION = math.radians(5.0)
"""A robot that turned further than this in the air fell because of it; with the momentum
constraint it turns by about 1 deg, without by 10."""

SLIP = 0.05
"""A sole that moved further than this on the ground slipped (m); tipping over the heel alone moves it by 3 cm."""


class Failure(StrEnum):
    """Classes of failed jumps; the first that applies counts."""

    DIVERGED = "diverged"
    NO_TAKEOFF = "no take-off"
    OVER_ROTATED = "over-rotated"
    SLIPPED = "slipped"
    FELL_FORWARD = "fell forward"
    FELL_BACKWARD = "fell backward"
    FELL_SIDEWAYS = "fell sideways"
    TOO_LOW = "too low"


def failure_in(info: Mapping[str, Any], success: SuccessConfig) -> Failure | None:
    """The failure class of a finished episode: that of its first jump that failed.

    Args:
        info: The info of its last step.
        success: What counts as a success.
    """
    if "series" not in info:
        return failure_of(info["outcome"], info["jump"], info["jump_height"], success)
    jumps, heights = info["jumps"], info["series"]["jump_heights"]
    outcomes = [*["stood"] * (len(jumps) - 1), info["outcome"]]
    for outcome, jump, height in zip(outcomes, jumps, heights, strict=True):
        failure = failure_of(outcome, jump, height, success)
        if failure is not None:
            return failure
    return None if info["is_success"] else Failure.NO_TAKEOFF


def failure_of(
    outcome: str, jump: Mapping[str, Any], jump_height: float, success: SuccessConfig
) -> Failure | None:
    """The failure class of a jump, or None for a success.

    A jump that did not land is classed by what came before the fall, else by its
    direction; one that landed can only have been too low.

    Args:
        outcome: ``info["outcome"]``.
        jump: ``info["jump"]``.
        jump_height: Commanded height (m).
        success: What counts as a success.
    """
    if outcome == "diverged":
        return Failure.DIVERGED
    if jump["flight_time"] < success.flight_time:
        return Failure.NO_TAKEOFF
    if jump["landed"]:
        low = jump["flight_height"] < success.height_ratio * jump_height
        return Failure.TOO_LOW if low else None
    if abs(jump["flight_rotation"]) > OVER_ROTATION:
        return Failure.OVER_ROTATED
    if jump["sole_slip"] > SLIP:
        return Failure.SLIPPED
    forward, left = jump["chest_lean"]
    if abs(left) > abs(forward):
        return Failure.FELL_SIDEWAYS
    return Failure.FELL_FORWARD if forward > 0.0 else Failure.FELL_BACKWARD
