"""The paper's plan: its numbers, calculus, refusals, and postures."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.errors import CommandNotScalableError
from icub_jump_env.planning.scaled_curve import (
    ACCELERATION_CURVE,
    DISPLACEMENT_CURVE,
    ScaledCurvePlan,
    plan_com_trajectory,
    takeoff_velocity,
)
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.statics import make_stance

ROBOT = load_robot()
STANCE = make_stance(FeetFixedKinematics(ROBOT), ROBOT.crouch)
CURVES = [DISPLACEMENT_CURVE, ACCELERATION_CURVE]


def test_paper_numbers_by_displacement():
    trajectory = plan_com_trajectory(0.04, 0.11)
    assert trajectory.takeoff_velocity == pytest.approx(0.886, abs=5e-4)
    assert trajectory.duration == pytest.approx(0.43, abs=5e-4)
    assert trajectory.displacement == pytest.approx(0.11)


def test_default_displacement_is_the_papers():
    assert plan_com_trajectory(0.04) == plan_com_trajectory(0.04, 0.11)


def test_by_acceleration_ends_in_free_fall_and_the_displacement_follows():
    trajectory = plan_com_trajectory(0.04, com_scaling="acceleration")
    assert trajectory.final_acceleration == pytest.approx(-GRAVITY)
    assert trajectory.sample(trajectory.duration).acceleration == pytest.approx(-GRAVITY)
    assert trajectory.takeoff_velocity == pytest.approx(0.886, abs=5e-4)
    assert trajectory.displacement == pytest.approx(0.11, abs=1e-3)


@pytest.mark.parametrize("curve", CURVES)
def test_normalised_curves_reach_one_at_one_from_rest(curve):
    assert curve.velocity(0.0) == curve.acceleration(0.0) == curve.position(0.0) == 0.0
    assert curve.velocity(1.0) == pytest.approx(1.0)
    assert curve.acceleration(1.0) == pytest.approx(curve.end_slope)


@given(st.sampled_from(CURVES), st.floats(0.01, 0.99))
def test_normalised_curves_are_derivatives_of_each_other(curve, u):
    step = 1e-5
    assert (curve.position(u + step) - curve.position(u - step)) / (2 * step) == pytest.approx(
        curve.velocity(u), abs=1e-8
    )
    assert (curve.velocity(u + step) - curve.velocity(u - step)) / (2 * step) == pytest.approx(
        curve.acceleration(u), abs=1e-8
    )


@pytest.mark.parametrize("curve", CURVES)
def test_peak_acceleration_is_the_peak(curve):
    sampled = max(curve.acceleration(i / 10000) for i in range(10001))
    assert curve.peak_acceleration == pytest.approx(sampled, rel=1e-6)


@given(st.floats(0.02, 0.054), st.sampled_from(["displacement", "acceleration"]))
def test_scaled_trajectory_is_consistent(height, scaling):
    trajectory = plan_com_trajectory(height, com_scaling=scaling)
    end = trajectory.sample(trajectory.duration)
    assert end.velocity == pytest.approx(math.sqrt(2 * GRAVITY * height))
    assert end.position == pytest.approx(trajectory.displacement)
    time, step = 0.6 * trajectory.duration, 1e-6
    before, here, after = (trajectory.sample(time + d) for d in (-step, 0.0, step))
    assert (after.position - before.position) / (2 * step) == pytest.approx(
        here.velocity, rel=1e-5
    )
    assert (after.velocity - before.velocity) / (2 * step) == pytest.approx(
        here.acceleration, rel=1e-5
    )


def test_energy_conservation():
    assert takeoff_velocity(0.04) ** 2 / (2 * GRAVITY) == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("arguments", "field", "reason"),
    [
        ((0.08, None, "acceleration"), "jump_height", "displacement"),
        ((0.04, 0.10, "acceleration"), "com_displacement", "follows"),
        ((0.15, 0.03, "displacement"), "com_displacement", "accelerate"),
    ],
)
def test_commands_that_cannot_be_scaled_are_refused_with_the_reason(arguments, field, reason):
    with pytest.raises(CommandNotScalableError, match=reason) as refusal:
        plan_com_trajectory(*arguments)
    assert refusal.value.field == field


def test_the_largest_height_named_in_a_refusal_is_accepted():
    with pytest.raises(CommandNotScalableError, match=r"at most 0\.054 m"):
        plan_com_trajectory(0.08, com_scaling="acceleration")
    plan_com_trajectory(0.054, com_scaling="acceleration")


class TestPlan:
    def plan(self, displacement=None, ballistic=False):
        return ScaledCurvePlan(plan_com_trajectory(0.04, displacement), ROBOT, STANCE, ballistic)

    def test_the_com_follows_the_curve_straight_up(self):
        plan = self.plan()
        for time in (0.0, 0.2, plan.duration):
            rise, setpoint = plan.trajectory.sample(time), plan.sample(time)
            np.testing.assert_array_equal(setpoint.com_position, [0, 0, rise.position])
            np.testing.assert_array_equal(setpoint.com_velocity, [0, 0, rise.velocity])
            np.testing.assert_array_equal(setpoint.com_acceleration, [0, 0, rise.acceleration])

    def test_the_posture_is_the_crouch_and_there_is_no_momentum(self):
        setpoint = self.plan().sample(0.3)
        np.testing.assert_array_equal(setpoint.posture, ROBOT.crouch)
        for still in (
            setpoint.posture_velocity,
            setpoint.posture_acceleration,
            setpoint.angular_momentum,
            setpoint.angular_momentum_rate,
        ):
            assert not still.any()

    def test_by_default_the_com_stays_where_it_is_at_T(self):
        plan = self.plan()
        last, later = (self.plan().sample(plan.duration + late) for late in (0.0, 0.1))
        for name in ("com_position", "com_velocity", "com_acceleration"):
            np.testing.assert_array_equal(getattr(later, name), getattr(last, name))

    @given(st.floats(1e-3, 0.3))
    def test_a_ballistic_com_falls_freely_after_T(self, late):
        """Central differences of the position, which for a parabola are exact."""
        plan, h = self.plan(ballistic=True), 1e-4
        times = plan.duration + late + h * np.array([-1.0, 0.0, 1.0])
        before, here, after = (plan.sample(time).com_position[2] for time in times)
        now = plan.sample(times[1])
        assert (after - before) / (2 * h) == pytest.approx(now.com_velocity[2], abs=1e-9)
        assert (after - 2 * here + before) / h**2 == pytest.approx(-GRAVITY, abs=1e-5)
        assert now.com_acceleration[2] == -GRAVITY

    def test_a_ballistic_com_takes_off_from_where_the_curve_ends_and_rises_as_commanded(self):
        plan = self.plan(ballistic=True)
        end = (
            plan.sample(plan.duration).com_position[2],
            plan.sample(plan.duration).com_velocity[2],
        )
        just_after = plan.sample(plan.duration + 1e-9)
        assert end == pytest.approx((0.11, math.sqrt(2 * GRAVITY * 0.04)))
        assert (just_after.com_position[2], just_after.com_velocity[2]) == pytest.approx(end)
        heights = [plan.sample(t).com_position[2] for t in np.linspace(0.4, 0.7, 3001)]
        assert max(heights) - 0.11 == pytest.approx(0.04, abs=1e-6)

    @pytest.mark.parametrize("displacement", [0.11, 0.14])
    def test_landing_posture_of_a_long_launch(self, displacement):
        np.testing.assert_allclose(self.plan(displacement).landing_posture, ROBOT.landing)

    def test_a_shorter_launch_lands_deeper(self):
        knee = ROBOT.joint_names.index("l_knee")
        knees = [self.plan(d).landing_posture[knee] for d in (0.05, 0.08, 0.11)]
        assert knees == sorted(knees)
        assert ROBOT.crouch[knee] < knees[0]
