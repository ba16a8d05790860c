"""The launch alone: its steps, its rewards, and what an agent sees and does in it."""

import functools
import pickle

import numpy as np
import pytest
from stable_baselines3.common.env_checker import check_env

from agents.environment import LaunchEnv, acting_steps
from agents.options import TASK
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.residual import COM_AXES as AXES
from icub_jump_env.policy import NetworkPolicy

CONFIG = TASK.replace(stand_time=0.1)
NAMES = tuple(DEFAULT.scales)
SOME = ("gyro.y", "launch_progress", "com_error.x")
STEPS = acting_steps(CONFIG)


def launch(env, actions, seed=0):
    """Observations, rewards and the last info of an episode."""
    observation, _ = env.reset(seed=seed)
    observations, rewards, ended = [observation], [], False
    while not ended:
        observation, reward, ended, truncated, info = env.step(actions[len(rewards)])
        assert not truncated
        observations.append(observation)
        rewards.append(reward)
    return np.array(observations), rewards, info


def plain(config, actions, seed=0):
    """The same of the environment itself, where zeros follow the actions."""
    env = make_env(config)
    observation, _ = env.reset(seed=seed)
    observations, rewards, ended = [observation], [], False
    while not ended:
        step = len(rewards)
        action = actions[step] if step < len(actions) else np.zeros(3, np.float32)
        observation, reward, ended, _, info = env.step(action)
        observations.append(observation)
        rewards.append(reward)
    return np.array(observations), rewards, info


@pytest.mark.parametrize("seed", [0, 1])
def test_an_episode_is_the_launch_with_the_rewards_of_all(rng, seed):
    """Forward and vertical are rows 0 and 2 of the action; observations are found by name."""
    actions = rng.uniform(-1, 1, (STEPS, 2)).astype(np.float32)
    residuals = np.zeros((STEPS, 3), np.float32)
    residuals[:, [0, 2]] = actions
    seen, rewards, info = launch(LaunchEnv(CONFIG, SOME, ("forward", "vertical")), actions, seed)
    everything, all_rewards, plain_info = plain(CONFIG, residuals, seed)
    assert len(rewards) == STEPS < len(all_rewards)
    assert rewards[:-1] == all_rewards[: STEPS - 1]
    assert sum(rewards) == pytest.approx(sum(all_rewards), rel=0, abs=1e-12)
    columns = [NAMES.index(name) for name in SOME]
    assert seen[:-1].tolist() == everything[:STEPS, columns].tolist()
    assert seen[-1].tolist() == everything[-1, columns].tolist()
    assert info == plain_info


def test_zero_actions_are_the_baseline():
    env = LaunchEnv(CONFIG, SOME, ("lateral",))
    _, rewards, info = launch(env, np.zeros((STEPS, 1), np.float32), seed=3)
    baseline = run_episode(make_env(CONFIG), 3)
    assert info["jump"] == baseline.jump
    assert info["outcome"] == baseline.outcome
    assert sum(rewards) == pytest.approx(baseline.reward, rel=0, abs=1e-12)


def test_actions_are_scaled():
    scaled = LaunchEnv(CONFIG, SOME, ("forward",))
    scaled.scale_actions(0.25)
    whole = LaunchEnv(CONFIG, SOME, ("forward",))
    ours = launch(scaled, np.full((STEPS, 1), 0.8, np.float32))
    theirs = launch(whole, np.full((STEPS, 1), 0.2, np.float32))
    assert ours[1] == theirs[1]
    assert ours[2] == theirs[2]
    assert ours[1] != launch(whole, np.full((STEPS, 1), 0.8, np.float32))[1]


def test_actions_beyond_one_are_clipped_before_they_are_scaled():
    env = LaunchEnv(CONFIG, SOME, ("forward",))
    env.scale_actions(0.25)
    ours = launch(env, np.full((STEPS, 1), 2.0, np.float32))
    assert ours[1:] == launch(env, np.ones((STEPS, 1), np.float32))[1:]


def test_a_jump_that_is_over_before_takes_as_many_steps():
    """Shifted sideways by 10 cm the robot falls in the launch."""
    config = JumpConfig.of(jump_height=0.02, residual_scale=(0.1, 0.1, 0.1))
    steps = acting_steps(config)
    actions = np.tile(np.array([0, 1, 0], np.float32), (steps, 1))
    _, all_rewards, plain_info = plain(config, actions)
    assert plain_info["outcome"] == "fell"
    assert len(all_rewards) < steps
    env = LaunchEnv(config, SOME, AXES)
    for _ in range(2):  # also after the next reset
        _, rewards, info = launch(env, actions)
        assert len(rewards) == steps
        assert sum(rewards) == sum(all_rewards)
        assert info["outcome"] == "fell"
        assert info["jump"] == plain_info["jump"]


@pytest.mark.parametrize("scaling", ["displacement", "acceleration"])
@pytest.mark.parametrize("height", [0.02, 0.04])
def test_no_launch_of_the_range_is_longer(scaling, height):
    config = JumpConfig.of(jump_height=(0.02, 0.04), com_scaling=scaling)
    env = make_env(config)
    observation, _ = env.reset(options={"jump_height": height})
    duration = observation[NAMES.index("takeoff_time")] * DEFAULT.scales["takeoff_time"]
    assert acting_steps(config) >= np.ceil(duration * config.agent_frequency - 1e-4)


def test_an_evaluation_is_of_the_policy_on_the_plain_environment():
    bias = np.array([0.3], np.float32)
    policy = NetworkPolicy((), ((np.zeros((1, 0), np.float32), bias),), ("vertical",))
    env = LaunchEnv(CONFIG, SOME, ("forward",))
    env.scale_actions(0.1)
    launch(env, np.ones((STEPS, 1), np.float32))
    plain = make_env(CONFIG)
    assert env.evaluate(policy, (7, 8)) == [run_episode(plain, seed, policy) for seed in (7, 8)]


def test_it_is_an_environment_that_workers_can_build():
    make = pickle.loads(pickle.dumps(functools.partial(LaunchEnv, CONFIG, SOME, ("forward",))))
    env = make()
    assert env.observation_space.shape == (3,)
    assert env.action_space.shape == (1,)
    check_env(env)
    env.close()
