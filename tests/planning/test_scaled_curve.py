"""CoM trajectory: the paper's numbers, calculus, and refusals."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.errors import CommandNotScalableError
from icub_jump_env.planning.scaled_curve import (
    ACCELERATION_CURVE,
    DISPLACEMENT_CURVE,
    plan_com_trajectory,
    takeoff_velocity,
)
from icub_jump_env.robot.icub import GRAVITY

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
