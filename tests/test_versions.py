"""The two registered environments."""

import dataclasses

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, random_action
from gymnasium.utils.env_checker import check_env

from icub_jump_env.config import JumpConfig
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.versions import VERSIONS

V1 = JumpConfig.of(**VERSIONS["ICubJump-v1"])


def test_v0_is_the_papers_jump():
    assert gymnasium.make("ICubJump-v0").unwrapped.config == JumpConfig()


def test_v1_differs_in_its_defaults_alone():
    assert gymnasium.make("ICubJump-v1").unwrapped.config == V1
    differing = {
        f.name: getattr(V1, f.name)
        for f in dataclasses.fields(JumpConfig)
        if getattr(V1, f.name) != getattr(JumpConfig(), f.name)
    }
    assert differing == {
        "planner": "whole_body", "estimator": "imu", "lean_correction": True, "flight": "feedback", "landing": "feedback",
    }  # fmt: skip
    paper = gymnasium.make(
        "ICubJump-v1", **{name: getattr(JumpConfig(), name) for name in differing}
    )
    assert paper.unwrapped.config == JumpConfig()


def test_v1_passes_gymnasiums_check():
    check_env(gymnasium.make("ICubJump-v1", stand_time=0.1).unwrapped, skip_render_check=True)


def states(actions, steps, **config):
    env = gymnasium.make("ICubJump-v1", **config).unwrapped
    env.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(actions(rng))
    return env.data.qpos.copy()


@pytest.mark.parametrize("controller", ["velocity", "torque"])
def test_a_zero_action_is_the_baseline_in_every_phase(controller):
    """Bit for bit, whatever its scale; and an action that is none has an effect in all."""
    config = {"controller": controller, "residual_phases": "all", "randomization": "full"}
    baseline = states(lambda rng: ZERO, 110, **config)
    wide = states(lambda rng: ZERO, 110, residual_scale=(0.1, 0.1, 0.1), **config)
    none = states(random_action, 110, residual_scale=(0.0, 0.0, 0.0), **config)
    np.testing.assert_array_equal(wide, baseline)
    np.testing.assert_array_equal(none, baseline)
    assert np.abs(states(random_action, 110, **config) - baseline).max() > 1e-3


@pytest.mark.parametrize("name", ["flight", "landing"])
def test_feedback_needs_the_imu(name):
    with pytest.raises(ValueError, match="only with estimator='imu'"):
        gymnasium.make("ICubJump-v0", **{name: "feedback"})


@pytest.mark.parametrize("controller", ["velocity", "torque"])
@pytest.mark.parametrize(
    "disturbance",
    [
        {"floor_tilt": (0.087, 0.087)},
        {"step": (0.02, 0.02)},
        {"takeoff_spin": (-0.9, -0.9)},
        {"flight_push": (-7.5, -7.5)},
        {"landing_push": (9.0, 9.0)},
    ],
    ids=str,
)
def test_it_lands_where_a_held_posture_falls(controller, disturbance):
    landed = []
    for version in VERSIONS:
        env = gymnasium.make(version, controller=controller, randomization=disturbance)
        env.reset(seed=0)
        terminated = False
        while not terminated:
            *_, terminated, _, info = env.step(ZERO)
        landed.append(info["jump"]["landed"])
    assert landed == [False, True]


@pytest.mark.parametrize("controller", ["velocity", "torque"])
@pytest.mark.parametrize(
    "changes",
    [
        {"sensors": "realistic", "actuators": "realistic"},
        {"solver": "osqp"},
        {"robot": "iCubGenova02", "planner": "scaled_curve"},
    ],
    ids=["realistic", "osqp", "another iCub"],
)
def test_feedback_lands_with_other_parts_too(controller, changes):
    """A jump onto a step under one foot."""
    env = gymnasium.make(
        "ICubJump-v1",
        controller=controller,
        stand_time=0.8,
        randomization=Randomization(step=(0.02, 0.02)),
        **changes,
    ).unwrapped
    env.reset(seed=0)
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step(ZERO)
    assert info["outcome"] == "stood"
    assert info["jump"]["landed"]
