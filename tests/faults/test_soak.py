"""Hours of use: memory stays, and the last episode is the first, bit for bit."""

import gc
import weakref

import gymnasium
import numpy as np
import psutil
import pytest

from icub_jump_env.errors import MissingDependencyError

MEGABYTE = 2**20
WARM = 0.25
"""Of the run, after which memory has to stay."""


def memory():
    """Of this process (MB)."""
    gc.collect()
    return psutil.Process().memory_info().rss / MEGABYTE


def play(env, seed, rng):
    """An episode with random actions; how many steps, and the last observation."""
    env.reset(seed=seed)
    for step in range(10_000):
        observation, _, terminated, *_ = env.step(rng.uniform(-1.0, 1.0, 3).astype(np.float32))
        if terminated:
            return step + 1, observation
    raise AssertionError("an episode without end")


@pytest.mark.fault("soak")
def test_memory_stays_over_many_steps(many):
    env = gymnasium.make("ICubJump-v1", randomization="hard", jump_height=(0.04, 0.06))
    wanted, steps, seed, warm = many(2_000, 2_000_000), 0, 0, None
    _, first = play(env, 0, np.random.default_rng(0))
    while steps < wanted:
        seed += 1
        steps += play(env, seed, np.random.default_rng(seed))[0]
        if warm is None and steps > WARM * wanted:
            warm = memory()
    grown = memory() - warm
    _, last = play(env, 0, np.random.default_rng(0))
    np.testing.assert_array_equal(last, first)
    assert grown < 20.0


def drawn():
    """An environment that has drawn a picture, in a graphics context of its own."""
    env = gymnasium.make("ICubJump-v1", render_mode="rgb_array", width=160, height=120)
    try:
        env.reset(seed=0)
        picture = env.render()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    assert picture.std() > 1.0
    return env


@pytest.mark.fault("soak")
def test_what_is_closed_is_freed(many):
    for _ in range(many(2, 20)):
        env = drawn()
        kept = weakref.ref(env.unwrapped)
        env.close()
        del env
        gc.collect()
        assert kept() is None


@pytest.mark.fault("soak")
def test_memory_stays_over_many_renderers(only_full, many):
    wanted, warm = many(0, 500), None
    for cycle in range(wanted):
        drawn().close()
        if cycle == wanted // 4:
            warm = memory()
    assert memory() - warm < 50.0
