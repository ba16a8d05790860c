"""A policy without the QP: what its actions do."""

import contextlib

import numpy as np
import pytest
from tiny_run import PPO

from agents.options import TrainOptions
from experiments.without_qp import JOINTS, JointEnv, WithoutOptions, learn
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError

CONFIG = JumpConfig.of(stand_time=0.1)


@pytest.fixture
def env():
    options = TrainOptions(env=CONFIG)
    with contextlib.closing(JointEnv(CONFIG, options.input_names)) as env:
        env.reset(seed=0)
        yield env


def test_the_crouch_is_an_action_of_zero_and_stands(env):
    for _ in range(20):
        env.step(np.zeros(len(JOINTS), np.float32))
    crouch, now = env.env.robot.crouch, env.env.snapshot()
    np.testing.assert_allclose(now.joint_position, crouch, atol=0.02)
    assert now.com[2] == pytest.approx(0.39, abs=0.01)


def test_a_joint_moves_on_both_sides_and_no_faster_than_it_may(env):
    robot, action = env.env.robot, np.zeros(len(JOINTS), np.float32)
    action[JOINTS.index("knee")] = 1.0
    before = env.env.snapshot().joint_position
    _, _, _, _, info = env.step(action)
    command = env.env.snapshot().joint_velocity_command
    knees = [robot.joint_names.index(f"{side}_knee") for side in "lr"]
    np.testing.assert_allclose(command[knees], robot.velocity_limit[knees])
    assert np.abs(np.delete(command, knees)).max() < 0.02
    moved = env.env.snapshot().joint_position - before
    assert (moved[knees] > 0.0).all()
    assert info["phase"] == "launch"


def test_it_learns_and_plays(monkeypatch):
    monkeypatch.setattr("experiments.without_qp.SELECTION", range(2))
    options = TrainOptions(env=CONFIG, ppo=PPO, jobs=1, timesteps=10)
    for info in learn(options):
        assert info["outcome"] in ("stood", "fell", "no take-off")


def test_what_it_sees_is_whitened_as_in_any_training(monkeypatch):
    monkeypatch.setattr("experiments.without_qp.SELECTION", range(1))
    monkeypatch.setattr("experiments.without_qp.play", lambda model, env, seed: model)
    (model,) = learn(TrainOptions(env=CONFIG, ppo=PPO, jobs=1, timesteps=10))
    whitening = model.policy.features_extractor
    assert whitening.mean.any()
    assert whitening.hidden_norm != 1.0


@pytest.mark.parametrize("change", [{"jobs": 0}, {"timesteps": 0}, {"seeds": 0}])
def test_bad_options_are_refused(change):
    with pytest.raises(ConfigError, match=next(iter(change))):
        WithoutOptions(**change)
