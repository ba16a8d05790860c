"""The failure classes, one example each, and their order."""

import math

import pytest

from icub_jump_env.evaluation.episodes.failures import Failure, failure_in, failure_of
from icub_jump_env.metrics.jump import SuccessConfig

GOOD = {
    "flight_time": 0.18, "landed": True, "flight_height": 0.04, "flight_rotation": 0.01,
    "sole_slip": 0.003, "chest_lean": (0.02, 0.0),
}  # fmt: skip
FELL = {"landed": False}


@pytest.mark.parametrize(
    ("outcome", "changes", "failure"),
    [
        ("stood", {}, None),
        ("diverged", {}, Failure.DIVERGED),
        ("no take-off", {"flight_time": 0.0} | FELL, Failure.NO_TAKEOFF),
        ("fell", {"flight_time": 0.05} | FELL, Failure.NO_TAKEOFF),
        ("stood", {"flight_height": 0.0279}, Failure.TOO_LOW),
        ("stood", {"flight_height": 0.0281}, None),
        ("fell", {"flight_rotation": -math.radians(5.1)} | FELL, Failure.OVER_ROTATED),
        ("stood", {"flight_rotation": -math.radians(5.1)}, None),
        ("fell", {"sole_slip": 0.06} | FELL, Failure.SLIPPED),
        ("fell", {"sole_slip": 0.06, "flight_rotation": 0.1} | FELL, Failure.OVER_ROTATED),
        ("fell", {"chest_lean": (1.0, 0.3)} | FELL, Failure.FELL_FORWARD),
        ("fell", {"chest_lean": (-1.0, 0.3)} | FELL, Failure.FELL_BACKWARD),
        ("fell", {"chest_lean": (-0.4, 0.9)} | FELL, Failure.FELL_SIDEWAYS),
        # Still on its feet, but bent: it did not land.
        ("stood", {"chest_lean": (0.6, 0.0)} | FELL, Failure.FELL_FORWARD),
        ("fell", {"flight_height": 0.01, "chest_lean": (1.0, 0.0)} | FELL, Failure.FELL_FORWARD),
    ],
)
def test_classes(outcome, changes, failure):
    assert failure_of(outcome, GOOD | changes, 0.04, SuccessConfig()) is failure


@pytest.mark.parametrize(
    ("success", "failure"),
    [
        (SuccessConfig(), None),
        (SuccessConfig(height_ratio=1.01), Failure.TOO_LOW),
        (SuccessConfig(flight_time=0.19), Failure.NO_TAKEOFF),
    ],
)
def test_what_counts_as_a_success_is_configured(success, failure):
    assert failure_of("stood", GOOD, 0.04, success) is failure


def several(*jumps, outcome="stood", success=True):
    """The info of a series of two jumps."""
    return {
        "outcome": outcome, "is_success": success, "jump": jumps[-1], "jumps": jumps,
        "jump_height": 0.04, "series": {"jump_heights": (0.04,) * len(jumps)},
    }  # fmt: skip


LOW = GOOD | {"flight_height": 0.01}


@pytest.mark.parametrize(
    ("info", "failure"),
    [
        (several(GOOD, GOOD), None),
        (several(LOW, GOOD, success=False), Failure.TOO_LOW),
        (several(LOW, GOOD | FELL, outcome="fell", success=False), Failure.TOO_LOW),
        (several(GOOD, GOOD | FELL, outcome="fell", success=False), Failure.FELL_FORWARD),
        (several(GOOD, outcome="diverged", success=False), Failure.DIVERGED),
        # It landed, and never jumped again.
        (several(GOOD, outcome="no take-off", success=False), Failure.NO_TAKEOFF),
    ],
)
def test_the_first_jump_that_failed_counts(info, failure):
    assert failure_in(info, SuccessConfig()) is failure
