"""The shaping filter of the residual."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.planning.reference import ComReference
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.planning.scaled_curve import plan_com_trajectory

targets = st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3).map(np.array)


def state(residual):
    return np.concatenate((residual.offset, residual.velocity, residual.acceleration))


def test_zero_stays_exactly_zero():
    residual = ResidualFilter()
    for _ in range(1000):
        residual.step(np.zeros(3), 0.005)
    assert not state(residual).any()


@given(targets, targets, st.floats(1e-4, 0.05))
def test_steps_compose(first, second, dt):
    """Two half steps equal one whole step: the solution is exact, not an approximation."""
    whole, halves = ResidualFilter(), ResidualFilter()
    for residual in (whole, halves):
        residual.step(first, 0.02)
    whole.step(second, dt)
    for _ in range(2):
        halves.step(second, dt / 2)
    np.testing.assert_allclose(state(halves), state(whole), atol=1e-12)


@given(targets, targets, st.floats(0.0, 0.1))
def test_velocity_and_acceleration_are_the_derivatives(first, second, time):
    h = 1e-5

    def at(t):
        residual = ResidualFilter()
        residual.step(first, 0.03)
        residual.step(second, t)
        return residual

    before, here, after = (at(time + h + d) for d in (-h, 0.0, h))
    np.testing.assert_allclose((after.offset - before.offset) / (2 * h), here.velocity, atol=1e-7)
    np.testing.assert_allclose(
        (after.velocity - before.velocity) / (2 * h), here.acceleration, atol=1e-6
    )


@given(targets)
def test_reaches_the_target_without_overshoot(target):
    residual = ResidualFilter()
    for _ in range(400):
        residual.step(target, 0.005)
        assert (np.abs(residual.offset) <= np.abs(target) + 1e-15).all()
    np.testing.assert_allclose(residual.offset, target, atol=1e-9)


def test_reference_is_trajectory_plus_residual():
    trajectory, start = plan_com_trajectory(0.04), np.array([0.02, 0.001, 0.39])
    reference = ComReference()
    reference.reset(trajectory, start)
    reference.residual.step(np.array([0.03, -0.01, 0.02]), 0.1)
    reference.update(0.3)
    rise, residual = trajectory.sample(0.3), reference.residual
    np.testing.assert_allclose(reference.position, start + residual.offset + [0, 0, rise.position])
    np.testing.assert_allclose(reference.velocity, residual.velocity + [0, 0, rise.velocity])
    np.testing.assert_allclose(
        reference.acceleration, residual.acceleration + [0, 0, rise.acceleration]
    )


def test_reset_forgets():
    reference = ComReference()
    reference.reset(plan_com_trajectory(0.04), np.zeros(3))
    reference.residual.step(np.ones(3), 0.1)
    reference.reset(plan_com_trajectory(0.04), np.zeros(3))
    assert not state(reference.residual).any()
    assert reference.position == pytest.approx(0.0)
