"""The minimum-jerk motion of the flight."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.planning.minimum_jerk import MinimumJerk

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
