"""The phase machine and the minimum-jerk motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.jump import landing_posture
from icub_jump_env.control.phases import ContactThresholds, Phase, PhaseMachine
from icub_jump_env.errors import ConfigError
from icub_jump_env.planning.minimum_jerk import MinimumJerk
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()

T = 0.43
WEIGHT = 324.0
DT = 0.005


def run(forces, start=0.0):
    machine = PhaseMachine()
    return [machine.update(start + i * DT, T, force) for i, force in enumerate(forces)]


def test_launch_ends_at_T_while_the_feet_still_carry_load():
    phases = run([WEIGHT] * 100)
    switch = phases.index(Phase.FLIGHT)
    assert switch * DT >= T > (switch - 1) * DT
    assert phases[-1] is Phase.FLIGHT


def test_launch_ends_at_lift_off_if_that_comes_first():
    phases = run([WEIGHT] * 10 + [0.0] * 5)
    assert phases[9] is Phase.LAUNCH
    assert phases[-1] is Phase.FLIGHT


def test_a_single_unloaded_tick_is_chatter():
    assert set(run([WEIGHT] * 5 + [0.0] + [WEIGHT] * 5 + [0.0] + [WEIGHT] * 5)) == {Phase.LAUNCH}


def test_flight_cannot_end_before_a_lift_off():
    phases = run([WEIGHT] * 20, start=T)
    assert set(phases) == {Phase.FLIGHT}


def test_flight_ends_at_the_first_contact_after_lift_off():
    phases = run([WEIGHT] * 5 + [0.0] * 10 + [500.0])
    assert phases[-2:] == [Phase.FLIGHT, Phase.LANDING]


@given(st.lists(st.sampled_from([0.0, 5.0, 20.0, 100.0, 1000.0]), max_size=200))
def test_phases_only_move_forward(forces):
    phases = run(forces)
    assert phases == sorted(phases)


@pytest.mark.parametrize(
    "values", [{"lift_off": -1.0}, {"touch_down": 5.0}, {"lift_off_ticks": 0}]
)
def test_bad_thresholds_are_refused(values):
    with pytest.raises(ConfigError) as refusal:
        ContactThresholds(**values)
    assert refusal.value.field in values


def test_reset_starts_over():
    machine = PhaseMachine()
    for i in range(200):
        machine.update(i * DT, T, 0.0)
    machine.reset()
    assert machine.update(0.0, T, WEIGHT) is Phase.LAUNCH
    assert not machine.airborne


vectors = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)


@given(vectors, vectors)
def test_minimum_jerk_starts_and_ends_at_rest(start, goal):
    motion = MinimumJerk(start, goal, 0.12)
    for time, where in ((0.0, start), (0.12, goal), (5.0, goal)):
        position, velocity = motion.sample(time)
        np.testing.assert_allclose(position, where, atol=1e-12)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-12)


@given(vectors, vectors, st.floats(0.01, 0.11))
def test_minimum_jerk_velocity_is_the_derivative(start, goal, time):
    motion, h = MinimumJerk(start, goal, 0.12), 1e-7
    before, after = (motion.sample(time + d)[0] for d in (-h, h))
    np.testing.assert_allclose((after - before) / (2 * h), motion.sample(time)[1], atol=1e-5)


def test_minimum_jerk_has_the_least_jerk():
    """Against other polynomials with the same ends: adding a bump only adds jerk."""
    u = np.linspace(0.0, 1.0, 20001)
    positions = np.array([MinimumJerk(np.zeros(1), np.ones(1), 1.0).sample(t)[0][0] for t in u])

    def jerk(values):
        third = np.diff(values, 3) / (u[1] - u[0]) ** 3
        return float((third**2).mean())

    bump = u**3 * (1 - u) ** 3
    coarse = slice(None, None, 100)
    u = u[coarse]
    best = jerk(positions[coarse])
    for size in (-0.5, -0.05, 0.05, 0.5):
        assert jerk((positions + size * bump)[coarse]) > best


@pytest.mark.parametrize("displacement", [0.11, 0.14])
def test_landing_posture_of_a_long_launch(displacement):
    np.testing.assert_allclose(landing_posture(ROBOT.crouch, displacement), ROBOT.landing)


def test_a_shorter_launch_lands_deeper():
    knee = ROBOT.joint_names.index("l_knee")
    knees = [landing_posture(ROBOT.crouch, d)[knee] for d in (0.05, 0.08, 0.11)]
    assert knees == sorted(knees)
    assert ROBOT.crouch[knee] < knees[0]
