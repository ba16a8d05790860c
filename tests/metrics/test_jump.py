"""Jump metrics on synthetic motions whose results are known in closed form."""

import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from icub_jump_env.errors import ConfigError
from icub_jump_env.metrics.jump import JumpMetrics, SuccessConfig
from icub_jump_env.metrics.recorder import CHATTER_TIME, JumpRecorder, has_stood
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.limits import JointLimits

DT = 1e-3
WEIGHT = 324.0
LIMITS = JointLimits({"n": 2}, lower=-1.0, upper=1.0, speed=5.0, torque=37.0)


def state(time, height=0.5, force=WEIGHT, **values):
    values = {"com": (0.0, 0.0, height)} | values
    return TrueState(2, time=time, ground_force=force, **values)


def leaning(forward, left=0.0):
    """The chest's up axis for leans in degrees."""
    up = np.array([math.tan(math.radians(forward)), math.tan(math.radians(left)), 1.0])
    return up / np.linalg.norm(up)


def ballistic(recorder, start, speed, height=0.5, **values):
    """Fly a parabola from ``height``; return the time and height of the landing."""
    steps = math.floor(2 * speed / GRAVITY / DT)
    for i in range(steps + 1):
        t = i * DT
        recorder.update(
            state(
                start + t,
                height + speed * t - GRAVITY * t**2 / 2,
                force=0.0,
                com_velocity=np.array([0.0, 0.0, speed - GRAVITY * t]),
                **{k: v(t) if callable(v) else v for k, v in values.items()},
            )
        )
    return start + (steps + 1) * DT


def stand(recorder, start, duration, **values):
    steps = round(duration / DT)
    for i in range(steps):
        recorder.update(state(start + i * DT, **values))
    return start + steps * DT


def recorded(speed=0.886, stand_time=0.3, **values):
    recorder = JumpRecorder(LIMITS, stand_time)
    time = stand(recorder, 0.0, 0.4)
    landing = ballistic(recorder, time, speed, **values)
    stand(recorder, landing, stand_time + 0.01)
    return recorder


@settings(max_examples=10)
@given(st.floats(0.2, 2.0))
def test_parabola(speed):
    metrics = recorded(speed).metrics
    height = speed**2 / (2 * GRAVITY)
    assert metrics.takeoff_time == pytest.approx(0.4)
    assert metrics.takeoff_velocity == pytest.approx(speed)
    assert metrics.ballistic_height == pytest.approx(height)
    assert metrics.flight_height == pytest.approx(height, abs=GRAVITY * DT**2)
    assert metrics.apex_height == pytest.approx(0.5 + height, abs=GRAVITY * DT**2)
    assert metrics.flight_time == pytest.approx(2 * speed / GRAVITY, abs=2 * DT)
    assert metrics.landed


def test_rotation_integrates_the_locked_angular_velocity():
    inertia = np.array([[2.0, 0.1, 0.0], [0.1, 1.5, 0.2], [0.0, 0.2, 0.7]])
    velocity = np.array([0.3, -0.8, 0.5])
    metrics = recorded(locked_inertia=inertia, angular_momentum=inertia @ velocity).metrics
    assert metrics.flight_rotation == pytest.approx(-0.8 * metrics.flight_time, rel=0.01)
    assert metrics.angular_momentum_takeoff == pytest.approx(tuple(inertia @ velocity))


def test_heights_and_pitch_are_those_in_flight():
    metrics = recorded(sole_height=lambda t: 0.2 * t, base_pitch=lambda t: 0.1 - t).metrics
    assert metrics.sole_height == pytest.approx(0.2 * metrics.flight_time, rel=0.01)
    assert metrics.base_pitch_range == pytest.approx(metrics.flight_time, rel=0.01)


def test_nothing_is_defined_without_a_flight():
    recorder = JumpRecorder(LIMITS, 0.3)
    stand(recorder, 0.0, 1.0)
    metrics = recorder.metrics
    assert metrics.flight_height == metrics.flight_time == 0.0
    for name in (
        "takeoff_time",
        "takeoff_velocity",
        "ballistic_height",
        "apex_height",
        "sole_height",
        "flight_rotation",
        "base_pitch_range",
    ):
        assert math.isnan(getattr(metrics, name))
    assert not metrics.landed
    assert not metrics.is_success(0.04, SuccessConfig())


def test_chatter_before_take_off_does_not_count():
    """A short loss of contact, lower than the flight: height counts from the last loss."""
    recorder = JumpRecorder(LIMITS, 0.3)
    time = stand(recorder, 0.0, 0.4)
    for i in range(3):
        recorder.update(state(time + i * DT, 0.5 + 0.8 * i * DT, force=0.0))
    time = stand(recorder, time + 3 * DT, 5 * DT, height=0.505)
    landing = ballistic(recorder, time, 0.886, height=0.51)
    stand(recorder, landing, 0.4)
    assert recorder.metrics.takeoff_time == pytest.approx(time)
    assert recorder.metrics.flight_height == pytest.approx(0.04, abs=1e-4)
    assert recorder.metrics.landed


def test_a_bounce_after_landing_does_not_count():
    recorder = JumpRecorder(LIMITS, 0.3)
    landing = ballistic(recorder, stand(recorder, 0.0, 0.4), 0.886)
    time = stand(recorder, landing, 0.05, height=0.46)
    time = ballistic(recorder, time, 0.3, height=0.46)
    stand(recorder, time, 0.4)
    assert recorder.metrics.takeoff_time == pytest.approx(0.4)
    assert recorder.metrics.takeoff_velocity == pytest.approx(0.886)
    assert recorder.touchdown_time == pytest.approx(landing)


def test_one_newton_is_airborne():
    for force, height in ((0.99, 0.04), (1.0, 0.0)):
        recorder = JumpRecorder(LIMITS, 0.3)
        for i in range(181):
            t = i * DT
            recorder.update(state(t, 0.5 + 0.886 * t - GRAVITY * t**2 / 2, force=force))
        assert recorder.metrics.flight_height == pytest.approx(height, abs=1e-4)


@pytest.mark.parametrize("when", ["launch", "flight", "landing", "never"])
def test_not_landed_if_anything_else_touched_at_any_time(when):
    recorder = JumpRecorder(LIMITS, 0.3)
    touch = {"only_feet_touch": False}
    at = {phase: touch if phase == when else {} for phase in ("launch", "flight", "landing")}
    time = stand(recorder, 0.0, 0.4, **at["launch"])
    landing = ballistic(recorder, time, 0.886, **at["flight"])
    time = stand(recorder, landing, 0.2, **at["landing"])
    stand(recorder, time, 0.2)
    assert has_stood(recorder.record.block[0])
    assert recorder.metrics.landed is (when == "never")


def test_the_chest_must_be_upright_when_the_stand_time_is_over():
    """Not before: the crouch itself leans by 30 deg."""
    for tilt, landed in ((31.0, False), (29.0, True)):
        recorder = JumpRecorder(LIMITS, 0.3)
        time = stand(recorder, 0.0, 0.4, chest_up=leaning(35.0))
        landing = ballistic(recorder, time, 0.886)
        stand(recorder, landing, 0.31, chest_up=leaning(tilt))
        assert recorder.metrics.landed is landed


def test_chatter_alone_is_no_flight():
    recorder = JumpRecorder(LIMITS, 0.0)
    time = stand(recorder, 0.0, 0.4)
    for i in range(15):
        recorder.update(state(time + i * DT, 0.5 + 0.2 * i * DT, force=0.0))
    stand(recorder, time + 15 * DT, 0.1)
    assert recorder.metrics.flight_height == 0.0
    assert math.isnan(recorder.metrics.takeoff_time)
    assert not has_stood(recorder.record.block[0])


def test_landed_only_after_the_stand_time():
    recorder = JumpRecorder(LIMITS, 0.3)
    landing = ballistic(recorder, stand(recorder, 0.0, 0.4), 0.886)
    time = stand(recorder, landing, 0.29)
    assert not recorder.metrics.landed
    stand(recorder, time, 0.02)
    assert recorder.metrics.landed


@pytest.mark.parametrize(
    ("values", "violated"),
    [
        ({"joint_velocity": np.array([0.0, -5.14])}, False),
        ({"joint_velocity": np.array([0.0, -5.16])}, True),
        ({"joint_torque": np.array([37.0, 0.0])}, False),
        ({"joint_torque": np.array([37.1, 0.0])}, True),
        ({"joint_position": np.array([1.0, 0.0])}, False),
        ({"joint_position": np.array([0.0, 1.01])}, True),
        ({"joint_position": np.array([-1.01, 0.0])}, True),
    ],
)
def test_limit_violations(values, violated):
    recorder = JumpRecorder(LIMITS, 0.3)
    stand(recorder, 0.0, 0.01, **values)
    assert recorder.metrics.limit_violations == (10.0 if violated else 0.0)


def test_peak_ground_force():
    recorder = JumpRecorder(LIMITS, 0.3)
    for i, force in enumerate((300.0, 1700.0, 400.0)):
        recorder.update(state(i * DT, force=force))
    assert recorder.metrics.peak_ground_force == 1700.0


def test_landing_force_is_that_after_the_touch_down_alone():
    recorder = JumpRecorder(LIMITS, 0.3)
    now = stand(recorder, 0.0, 0.01, force=2000.0)
    assert math.isnan(recorder.metrics.landing_force)
    now = ballistic(recorder, now, speed=0.9)
    for force in (300.0, 1500.0, 400.0):
        recorder.update(state(now, force=force))
        now += DT
    assert recorder.metrics.landing_force == 1500.0


def test_joint_work_counts_driving_and_braking():
    recorder = JumpRecorder(LIMITS, 0.3)
    values = {"joint_torque": np.array([10.0, 20.0]), "joint_velocity": np.array([2.0, -0.5])}
    stand(recorder, 0.0, 0.101, **values)
    assert recorder.metrics.joint_work == pytest.approx((10.0 * 2.0 + 20.0 * 0.5) * 0.1)


@pytest.mark.parametrize(
    ("changes", "thresholds", "success"),
    [
        ({}, {}, True),
        ({"landed": False}, {}, False),
        ({"flight_time": 0.099}, {}, False),
        ({"flight_height": 0.0279}, {}, False),
        ({"flight_height": 0.0281}, {}, True),
        ({"flight_time": 0.099}, {"flight_time": 0.05}, True),
        ({}, {"flight_time": 0.2}, False),
        ({"flight_height": 0.0279}, {"height_ratio": 0.5}, True),
        ({}, {"height_ratio": 1.1}, False),
    ],
)
def test_success(changes, thresholds, success):
    values = {"landed": True, "flight_time": 0.19, "flight_height": 0.04} | changes
    assert JumpMetrics(**values).is_success(0.04, SuccessConfig(**thresholds)) is success


@pytest.mark.parametrize("field", ["flight_time", "height_ratio", "stand_time"])
@pytest.mark.parametrize("value", [-0.1, math.nan, 100.0, "long", True])
def test_bad_thresholds_are_refused(field, value):
    with pytest.raises(ConfigError) as refusal:
        SuccessConfig(**{field: value})
    assert refusal.value.field == field


def test_metrics_are_plain_floats_and_bools():
    for name, value in recorded().metrics.as_dict().items():
        values = value if isinstance(value, tuple) else [value]
        assert all(type(v) in (float, bool) for v in values), name


def test_undefined_is_a_nan_that_equals_itself():
    undefined = JumpMetrics().takeoff_time
    assert len({undefined, pickle.loads(pickle.dumps(undefined))}) == 1
    assert isinstance(undefined, float)
    assert math.isnan(undefined)
    assert undefined != undefined
    assert JumpMetrics() == JumpMetrics()
    assert pickle.loads(pickle.dumps(undefined)) == undefined
    assert undefined != 0.0
    assert json.dumps(undefined) == "NaN"


class TestFlights:
    def three_jumps(self):
        """Jumps of 0.5, 0.9 and 0.7 m/s with loss of contact for 10 ms in between."""
        recorder, time, starts = JumpRecorder(LIMITS, 0.3), 0.0, []
        for speed in (0.5, 0.9, 0.7):
            time = stand(recorder, time, 0.2)
            starts.append(time)
            time = ballistic(recorder, time, speed)
            time = stand(recorder, time, 0.05)
            for i in range(10):
                recorder.update(state(time + i * DT, force=0.0))
            time += 10 * DT
        stand(recorder, time, 0.4)
        return recorder, starts

    def test_the_metrics_are_those_of_the_highest(self):
        recorder, starts = self.three_jumps()
        metrics, speed = recorder.metrics, 0.9
        height = speed**2 / (2 * GRAVITY)
        assert metrics.takeoff_time == pytest.approx(starts[1])
        assert metrics.flight_time == pytest.approx(2 * speed / GRAVITY, abs=2 * DT)
        assert metrics.flight_height == pytest.approx(height, abs=GRAVITY * DT**2)
        assert metrics.takeoff_velocity == pytest.approx(speed)
        touch_down = metrics.takeoff_time + metrics.flight_time
        assert recorder.touchdown_time == pytest.approx(touch_down)
        assert metrics.landed

    @pytest.mark.parametrize(("steps", "flies"), [(20, False), (21, True)])
    def test_a_flight_lasts_20_ms(self, steps, flies):
        recorder = JumpRecorder(LIMITS, 0.3)
        for i in range(steps):
            recorder.update(state(i * CHATTER_TIME / 20, force=0.0))
        assert (recorder.metrics.flight_time > 0.0) is flies

    def test_reset_forgets_them(self):
        recorder, _ = self.three_jumps()
        recorder.reset()
        assert recorder.metrics == JumpMetrics()


def test_a_higher_second_flight_starts_the_standing_anew():
    recorder = JumpRecorder(LIMITS, 0.3)
    time = stand(recorder, 0.0, 0.4)
    landing = ballistic(recorder, time, 0.5)
    time = stand(recorder, landing, 0.1)
    assert recorder.touchdown_time == pytest.approx(landing)
    for step in range(100):
        recorder.update(state(time + step * DT, 0.6 + 0.001 * step, force=0.0))
    assert math.isnan(recorder.touchdown_time)
    stand(recorder, time + 100 * DT, 0.25)
    assert not has_stood(recorder.record.block[0])


class TestSlip:
    def soles(self, x=0.0, y=0.0):
        return np.array([x, 0.07 + y, 0.0]), np.array([0.0, -0.07, 0.0])

    def test_largest_way_on_the_ground_from_the_start(self):
        recorder = JumpRecorder(LIMITS, 0.3)
        stand(recorder, 0.0, 0.1, sole_position=self.soles())
        stand(recorder, 0.1, 0.1, sole_position=self.soles(0.03, 0.04))
        stand(recorder, 0.2, 0.1, sole_position=self.soles(0.01))
        assert recorder.metrics.sole_slip == pytest.approx(0.05)

    def test_flight_is_no_slip(self):
        """The robot lands 20 cm further on and slips 1 cm there."""
        recorder = JumpRecorder(LIMITS, 0.3)
        time = stand(recorder, 0.0, 0.4, sole_position=self.soles())
        landing = ballistic(recorder, time, 0.886, sole_position=lambda t: self.soles(t))
        time = stand(recorder, landing, 0.2, sole_position=self.soles(0.2))
        assert recorder.metrics.sole_slip == 0.0
        stand(recorder, time, 0.2, sole_position=self.soles(0.21))
        assert recorder.metrics.sole_slip == pytest.approx(0.01)

    def test_a_bounce_is_no_slip(self):
        recorder = JumpRecorder(LIMITS, 0.3)
        time = stand(recorder, 0.0, 0.4, sole_position=self.soles())
        landing = ballistic(recorder, time, 0.886, sole_position=self.soles())
        landing = stand(recorder, landing, 0.05, sole_position=self.soles())
        landing = ballistic(recorder, landing, 0.2, sole_position=lambda t: self.soles(t))
        stand(recorder, landing, 0.2, sole_position=self.soles(0.05))
        assert recorder.metrics.sole_slip == 0.0

    def test_a_toppling_robot_moves_its_soles_without_slipping(self):
        recorder = JumpRecorder(LIMITS, 0.3)
        stand(recorder, 0.0, 0.1, sole_position=self.soles())
        stand(recorder, 0.1, 0.1, sole_position=self.soles(0.5), chest_up=leaning(31.0))
        assert recorder.metrics.sole_slip == 0.0


@pytest.mark.parametrize("fast", [(0.051, 0.0, 0.0), (0.0, -0.051, 0.0), (0.0, 0.0, 0.051)])
def test_still_is_who_has_been_slow_since(fast):
    """Slow for 0.2 s, then in one direction too fast, then slow for 0.3 s."""
    recorder = JumpRecorder(LIMITS, 1.0)
    for step in range(501):
        velocity = fast if step == 200 else (0.03, 0.0, -0.039)
        recorder.update(state(step * DT, com_velocity=velocity))
        if step == 199:
            assert recorder.metrics.still_time == pytest.approx(0.199)
        if step == 200:
            assert recorder.metrics.still_time == 0.0
    assert recorder.metrics.still_time == pytest.approx(0.3)
    recorder.reset()
    assert recorder.metrics.still_time == 0.0


def test_metrics_that_nobody_recorded_are_those_before_anything_happened():
    recorder = JumpRecorder(LIMITS, 1.0)
    recorder.reset()
    np.testing.assert_equal(JumpMetrics().as_dict(), recorder.metrics.as_dict())


def test_lean_is_that_of_the_end():
    recorder = JumpRecorder(LIMITS, 0.3)
    stand(recorder, 0.0, 0.1, chest_up=leaning(40.0, 10.0))
    stand(recorder, 0.1, 0.1, chest_up=leaning(-20.0, 5.0))
    np.testing.assert_allclose(np.degrees(recorder.metrics.chest_lean), [-20.0, 5.0])


class TestAJumpThatAnotherFollows:
    def recorder(self, began=7.0):
        recorder = JumpRecorder(LIMITS, 2.0)
        recorder.reset(began, rest=0.5)
        self.landing = ballistic(recorder, stand(recorder, began, 0.4), 0.886)
        return recorder

    def test_its_times_are_those_since_its_start(self):
        recorder, alone = self.recorder(), JumpRecorder(LIMITS, 2.0)
        ballistic(alone, stand(alone, 0.0, 0.4), 0.886)
        assert recorder.metrics.takeoff_time == pytest.approx(0.4)
        assert recorder.metrics.flight_time == pytest.approx(alone.metrics.flight_time)
        stand(recorder, self.landing, 0.1)
        assert recorder.touchdown_time == pytest.approx(self.landing - 7.0)

    @pytest.mark.parametrize(
        ("rested", "crouched", "landed"),
        [
            ({}, {"chest_up": leaning(31.0)}, True),
            ({"chest_up": leaning(31.0)}, {"chest_up": leaning(31.0)}, False),
            ({}, {"only_feet_touch": False}, False),
            ({"only_feet_touch": False}, {}, False),
        ],
    )
    def test_it_landed_if_it_stood_before_it_crouched(self, rested, crouched, landed):
        recorder = self.recorder()
        now = stand(recorder, self.landing, 0.51, **rested)
        stand(recorder, now, 0.9, **crouched)
        recorder.conclude()
        assert recorder.metrics.landed is landed
