"""The rivals: a constant shift chosen by reward, and a policy's mean action replayed."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from agents.environment import acting_steps
from agents.options import TASK
from experiments import rivals
from experiments.rivals import best_constant, constant_shift, open_loop
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.observation import DEFAULT
from icub_jump_env.policy import NetworkPolicy

CONFIG = TASK.replace(stand_time=0.1)
CONSOLE = Console(quiet=True)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(rivals, "FORWARD", (0.0, 0.4))
    monkeypatch.setattr(rivals, "VERTICAL", (-0.5, 0.5))
    monkeypatch.setattr(rivals, "_COMMANDS", 2)


def test_a_constant_is_the_same_whatever_the_observation(rng):
    policy = constant_shift(0.3, -0.5)
    expected = np.array([0.3, 0.0, -0.5], np.float32)
    for observation in rng.uniform(-10, 10, (3, 80)).astype(np.float32):
        assert np.array_equal(policy(observation), expected)


@pytest.mark.parametrize("best", list(itertools.product((0.0, 0.4), (-0.5, 0.5))))
def test_the_constant_with_the_largest_mean_reward_is_chosen(monkeypatch, best):
    """By what it wins with its second seed."""

    def reward(job):
        is_best = np.array_equal(job.policy.layers[0][1], np.float32(best))
        return {11: 2.0, 12: 1.0 + is_best}[job.seed]

    def run_all(work, jobs, console):
        return [SimpleNamespace(reward=reward(job)) for job in work]

    monkeypatch.setattr(rivals, "run_all", run_all)
    policy = best_constant(CONFIG, 1, CONSOLE, seeds=(11, 12))
    assert policy(np.zeros(80, np.float32)).tolist() == np.float32([best[0], 0, best[1]]).tolist()


def test_the_better_constant_of_two_is_chosen(monkeypatch):
    monkeypatch.setattr(rivals, "VERTICAL", (0.0,))
    env = make_env(CONFIG)
    rewards = {
        forward: sum(
            run_episode(env, seed, constant_shift(forward, 0.0)).reward for seed in (3, 4)
        )
        for forward in rivals.FORWARD
    }
    assert len(set(rewards.values())) == 2
    chosen = best_constant(CONFIG, 1, CONSOLE, seeds=(3, 4))
    assert chosen.layers[0][1][0] == np.float32(max(rewards, key=rewards.get))


def test_a_constant_replayed_is_the_constant_bit_for_bit():
    policy = constant_shift(0.3, -0.1)
    replay = open_loop(policy, CONFIG, CONSOLE, seeds=range(6))
    assert replay.commands.tolist() == np.float32([0.04, 0.08]).tolist()
    assert replay.actions.shape == (2, acting_steps(CONFIG), 3)
    constant = policy(np.zeros(80, np.float32))
    assert np.array_equal(replay.actions, np.broadcast_to(constant, replay.actions.shape))
    env = make_env(CONFIG)  # which draws commands between those of the table
    assert run_episode(env, 20, replay) == run_episode(env, 20, policy)


def clock():
    """A policy whose forward action is half the time in seconds."""
    layer = np.full((1, 1), 0.5, np.float32), np.zeros(1, np.float32)
    return NetworkPolicy(("time",), (layer,), ("forward",))


def test_a_plan_replayed_makes_the_same_jump():
    config = CONFIG.replace(jump_height=0.05)
    replay = open_loop(clock(), config, CONSOLE, seeds=range(2))
    (table,) = replay.actions  # of the one command
    times = np.arange(len(table)) / config.agent_frequency
    np.testing.assert_allclose(table[:, 0], 0.5 * times, rtol=0, atol=1e-6)
    assert not table[:, 1:].any()
    env = make_env(config)
    assert run_episode(env, 9, replay).jump == run_episode(env, 9, clock()).jump


def test_each_command_has_the_mean_of_its_own_episodes():
    """Here the action is a function of command and seed, by way of the drawn gravity reading."""
    names = ("jump_height", "gyro.y")
    weight = np.array([[0.2, 1.0]], np.float32), np.zeros(1, np.float32)
    policy = NetworkPolicy(names, (weight,), ("vertical",))
    config = CONFIG.replace(sensors="realistic")
    replay = open_loop(policy, config, CONSOLE, seeds=range(4))
    for command, table, seeds in zip((0.04, 0.08), replay.actions, ((0, 2), (1, 3)), strict=True):
        env = make_env(config.replace(jump_height=command))
        firsts = [policy(env.reset(seed=seed)[0])[2] for seed in seeds]
        assert firsts[0] != firsts[1]
        assert table[0, 2] == pytest.approx(np.mean(firsts), abs=1e-6)


def test_a_fall_in_the_launch_leaves_the_remaining_steps_zero():
    config = JumpConfig.of(jump_height=0.02, residual_scale=(0.1, 0.1, 0.1))
    layer = np.zeros((1, 0), np.float32), np.ones(1, np.float32)
    sideways = NetworkPolicy((), (layer,), ("lateral",))
    (table,) = open_loop(sideways, config, CONSOLE, seeds=(0,)).actions
    assert table[0].tolist() == [0, 1, 0]
    assert not table[-1].any()
    assert DEFAULT.scales["time"] == 1.0  # as clock() has it
