"""The shaping filter of the residual."""

import re
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.planning.residual import AXES, N_AXES, ResidualConfig, ResidualFilter

targets = st.lists(st.floats(-0.1, 0.1), min_size=N_AXES, max_size=N_AXES).map(np.array)


def state(residual):
    return np.concatenate((residual.offset, residual.velocity, residual.acceleration))


def test_zero_stays_exactly_zero():
    residual = ResidualFilter(15.0)
    for _ in range(1000):
        residual.step(np.zeros(N_AXES), 0.005)
    assert not state(residual).any()


@given(targets, targets, st.floats(1e-4, 0.05))
def test_steps_compose(first, second, dt):
    """Two half steps equal one whole step: the solution is exact, not an approximation."""
    whole, halves = ResidualFilter(15.0), ResidualFilter(15.0)
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
        residual = ResidualFilter(15.0)
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
    residual = ResidualFilter(15.0)
    for _ in range(400):
        residual.step(target, 0.005)
        assert (np.abs(residual.offset) <= np.abs(target) + 1e-15).all()
    np.testing.assert_allclose(residual.offset, target, atol=1e-9)


def test_a_step_is_90_percent_done_after_0_26_s_at_the_default_bandwidth():
    residual = ResidualFilter(ResidualConfig().bandwidth)
    residual.step(np.ones(N_AXES), 0.26)
    np.testing.assert_allclose(residual.offset, 0.9, atol=0.005)


def test_an_action_of_1_moves_each_axis_by_what_the_document_says():
    document = (Path(__file__).parents[2] / "docs" / "environment.md").read_text()
    rows = re.findall(
        r"^\| (`forward`.*|`roll`.*) \| .* \| ([\d., ]+) \w.* \|$", document, re.MULTILINE
    )
    names = [name for axes, _ in rows for name in re.findall(r"`(\w+)`", axes)]
    told = [float(number) for _, numbers in rows for number in numbers.split(",")]
    assert tuple(names) == AXES
    config = ResidualConfig(axes=AXES)
    np.testing.assert_array_equal(config.matrix @ np.ones(N_AXES), told)


def test_twice_the_bandwidth_is_twice_as_fast():
    slow, fast = ResidualFilter(10.0), ResidualFilter(20.0)
    slow.step(np.ones(N_AXES), 0.1)
    fast.step(np.ones(N_AXES), 0.05)
    np.testing.assert_allclose(fast.offset, slow.offset, atol=1e-12)
    np.testing.assert_allclose(fast.velocity, 2 * slow.velocity, atol=1e-12)
