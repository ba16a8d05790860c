"""When an episode is over, and what its jumps say together."""

import math

import numpy as np
import pytest

from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.metrics.recorder import JumpRecorder
from icub_jump_env.metrics.series import (
    FELL,
    NEXT_GRACE,
    NO_TAKEOFF,
    RUNNING,
    STOOD,
    TAKEOFF_GRACE,
    Rules,
    SeriesRecorder,
    judge,
)
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.robot.limits import JointLimits

LIMITS = JointLimits({"n": 2}, lower=-1.0, upper=1.0, speed=5.0, torque=37.0)
TOUCHDOWN, TAKEOFF = 0.5, 0.25


def verdict(time, last=False, flown=True, **state):
    """Of a robot that stands upright, by default after a jump that touched down at 0.5 s."""
    rules, recorder = Rules(), JumpRecorder(LIMITS, 1.0)
    rules.takeoff_time, rules.is_last = TAKEOFF, float(last)
    rules.foreseen_from = math.inf
    record = recorder.record
    if flown:
        record.takeoff_time, record.touchdown_time = TAKEOFF, TOUCHDOWN
    record.last_time = time
    values = {"ground_force": 300.0, "only_feet_touch": 1.0, "chest_up": (0.0, 0.0, 1.0)} | state
    return judge(TrueState(2, time=time, **values).block, rules.block, record.block)


def test_the_next_jump_has_to_begin_in_time():
    assert verdict(TOUCHDOWN + NEXT_GRACE - 0.001) == RUNNING
    assert verdict(TOUCHDOWN + NEXT_GRACE) == NO_TAKEOFF
    assert verdict(TOUCHDOWN + NEXT_GRACE + 0.001) == NO_TAKEOFF
    assert verdict(0.25 * NEXT_GRACE) == RUNNING


def test_the_last_one_is_over_when_it_has_stood():
    assert verdict(TOUCHDOWN + 0.999, last=True) == RUNNING
    assert verdict(TOUCHDOWN + 1.0, last=True) == STOOD


def test_a_launch_has_to_leave_the_ground_in_time():
    assert verdict(TAKEOFF + TAKEOFF_GRACE - 0.001, flown=False) == RUNNING
    assert verdict(TAKEOFF + TAKEOFF_GRACE, flown=False) == NO_TAKEOFF
    assert verdict(TAKEOFF + TAKEOFF_GRACE, flown=False, ground_force=0.0) == RUNNING


@pytest.mark.parametrize(
    ("lean", "expected"), [(0.0, RUNNING), (59.0, RUNNING), (61.0, FELL), (170.0, FELL)]
)
def test_who_leans_too_far_has_fallen(lean, expected):
    for sign in (-1.0, 1.0):
        angle = math.radians(sign * lean)
        assert verdict(1.0, chest_up=(math.sin(angle), 0.0, math.cos(angle))) == expected


def test_who_touches_with_anything_else_has_fallen():
    assert verdict(1.0, only_feet_touch=0.0) == FELL


def test_three_jumps_together():
    series = SeriesRecorder(3, LIMITS, SuccessConfig())
    series.reset()
    soles = np.array([[0.1, 0.2, 0.0], [0.1, -0.2, 0.0]])
    start = TrueState(2, sole_position=soles)
    for number, force in enumerate((900.0, 700.0, 1200.0)):
        series.begin(0.04, TAKEOFF, start, 5.0 * number, 0.5 if number < 2 else None, math.inf)
        series.present.record.landing_force = force
    now = TrueState(2, sole_position=soles + [[0.03, 0.01, 0.0], [0.05, 0.01, 0.0]])
    found = series.as_dict(now)
    assert (found["jumps"], found["landed"]) == (3, 0)
    assert found["landing_force"] == 1200.0
    assert found["drift"] == pytest.approx((0.04, 0.01))
    assert series.is_last
    assert not series.is_success
