"""Episodes that end early: they are right, and end when they may."""

import math

import numpy as np
import pytest
from conftest import rollout
from hypothesis import given
from hypothesis import strategies as st

from experiments.foresight import compare
from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ConfigError
from icub_jump_env.metrics.foresight import (
    CALM_TIME,
    EARLIEST,
    FALL_TIME,
    capture_point,
    foresee,
    is_calm,
)
from icub_jump_env.metrics.recorder import JumpRecord
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.planning.residual import RESIDUAL_TIME
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.versions import VERSIONS

ZERO = np.zeros(3, np.float32)


def standing(**changes) -> TrueState:
    state = TrueState(23)
    values = {
        "com": (0.3, 0.1, 0.5),
        "sole_position": ((0.3, 0.17, 0.0), (0.3, 0.03, 0.0)),
        "chest_up": (0.0, 0.0, 1.0),
    }
    for name, value in (values | changes).items():
        getattr(state, name)[:] = value
    return state


def verdicts(*states, after=EARLIEST, step=0.01):
    """Of states that follow one another, from ``after`` (s) touch-down on."""
    jump = JumpRecord()
    jump.touchdown_time, jump.rest = 0.6, 2.0
    return [
        foresee(state.block[0], 0.6 + after + k * step, jump.block[0])
        for k, state in enumerate(states)
    ]


@given(st.floats(0.35, 0.6), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_the_capture_point_is_where_a_pendulum_comes_to_rest(height, forward, left):
    """From there the exponential that grows has no part in x(t) = p + (x - p) e^(-w t)."""
    state = standing(com=(0.3, 0.1, height), com_velocity=(forward, left, 0.5))
    w = math.sqrt(9.81 / height)
    expected = np.array([forward, left]) / w
    np.testing.assert_allclose(capture_point(state.block[0]), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("com", (0.36, 0.1, 0.5)),
        ("com", (0.3, 0.16, 0.5)),
        ("com_velocity", (0.0, 0.0, 0.11)),
        ("com_velocity", (0.05, 0.1, 0.0)),
        ("com_velocity", (0.1, 0.05, 0.0)),
        ("angular_momentum", (0.0, -0.5, 0.0)),
        ("angular_momentum", (0.5, 0.0, 0.0)),
        ("angular_momentum", (0.35, 0.35, 0.0)),
        ("chest_up", (math.sin(0.43), 0.0, math.cos(0.43))),
        ("chest_up", (0.0, math.sin(0.15), math.cos(0.15))),
    ],
)
def test_each_motion_alone_is_not_calm(field, value):
    assert is_calm(standing().block[0], 0.0, 0.0)
    state = standing(**{field: value}).block[0]
    assert not is_calm(state, *capture_point(state))


def test_a_robot_that_stays_calm_will_stand():
    calm, restless = standing(), standing(com_velocity=(0.12, 0.0, 0.0))
    dwell = round(CALM_TIME / 0.01)
    assert verdicts(restless, *[calm] * (dwell + 1)) == [*[0] * dwell, 1, 1]
    assert verdicts(*[calm] * dwell, restless, calm)[-1] == 0


@pytest.mark.parametrize("com", [(0.49, 0.1, 0.5), (0.11, 0.1, 0.5), (0.3, 0.25, 0.5)])
def test_a_robot_whose_capture_point_has_left_the_soles_will_fall(com):
    lost = standing(com=com)
    assert verdicts(lost) == [-1]
    assert verdicts(lost, after=EARLIEST - 0.01) == [0]
    late = 2.0 - FALL_TIME  # it might still be falling when it has stood long enough
    assert verdicts(lost, lost, after=late - 0.005) == [-1, 0]


@pytest.mark.parametrize("controller", ["velocity", "torque"])
@pytest.mark.parametrize("name", sorted(VERSIONS))
def test_an_early_end_is_right(name, controller):
    """``python -m experiments.foresight`` does the same with a thousand episodes."""
    config = JumpConfig.of(**VERSIONS[name], controller=controller, randomization="disturbed")
    ends = compare(config, range(6))
    assert {whole.landed for _, whole in ends} == {False, True}
    assert [early.landed for early, _ in ends] == [whole.landed for _, whole in ends]
    early, whole = np.sum([(early.steps, whole.steps) for early, whole in ends], axis=0)
    assert 1.2 * early < whole


def test_until_it_ends_it_is_the_same_episode():
    early, whole = (
        rollout(ICubJumpEnv(early_end=ends), lambda *_: ZERO, seed=2) for ends in (True, False)
    )
    steps = len(early[1])
    assert 50 < steps < len(whole[1]) / 2
    for ours, all_of_it in zip(early[:2], whole[:2], strict=True):
        np.testing.assert_array_equal(ours[: steps - 1], all_of_it[: steps - 1])
    assert early[2]["jump"]["landed"] is whole[2]["jump"]["landed"] is True


def ended(**config):
    """Time (s) since touch-down and whether it landed, of an episode that may end early."""
    env = ICubJumpEnv(early_end=True, **config)
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, _, terminated, _, info = env.step(ZERO)
    jump = info["jump"]
    return info["time"] - jump["takeoff_time"] - jump["flight_time"], jump["landed"]


def test_a_push_that_is_to_come_is_waited_for():
    assert ended()[0] < 0.5
    pushed = Randomization(landing_push=(15.0, 15.0), landing_push_time=(0.8, 0.8))
    time, landed = ended(randomization=pushed)
    assert not landed
    assert time > 0.85


def test_a_residual_that_still_acts_is_waited_for():
    env = ICubJumpEnv(residual_phases="all", early_end=True)
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, _, terminated, _, info = env.step(ZERO)
    until = env._controller.plan.duration + RESIDUAL_TIME
    assert until <= info["time"] < until + 0.1
    assert info["jump"]["landed"]


def test_only_the_last_jump_of_a_series_ends_early():
    env = ICubJumpEnv(jumps=2, early_end=True)
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, _, terminated, _, info = env.step(ZERO)
    assert [jump["landed"] for jump in info["jumps"]] == [True, True]


def test_it_is_off_by_default():
    assert not JumpConfig().success.early_end
    with pytest.raises(ConfigError, match="early_end"):
        JumpConfig.of(early_end=1)
