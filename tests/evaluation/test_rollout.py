"""Episodes of a policy: what acts, and how often."""

import dataclasses
import io

import pytest
from conftest import rollout
from contenders import FEEDBACK, constant
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
from icub_jump_env.evaluation.episodes.series import perturbed
from icub_jump_env.evaluation.modes.nominal import run_nominal
from icub_jump_env.simulation.randomization import Randomization

RANDOM = {"randomization": "full", "sensors": "realistic", "stand_time": 0.1}


def untraced(episode):
    """Without what depends on how often the environment is stepped.

    The residual is charged for at each step.
    """
    return dataclasses.replace(episode, trace=(), reward=0.0)


class Watched:
    """A policy that remembers what it saw."""

    def __init__(self, policy):
        self.policy, self.seen = policy, []

    def __call__(self, observation):
        self.seen.append(observation.tobytes())
        return self.policy(observation)


def test_an_episode_says_what_was_asked_for_and_what_came_of_it():
    config = JumpConfig.of(jump_height=(0.03, 0.05), stand_time=0.1)
    env = make_env(config)
    episode = run_episode(env, 3)
    _, rewards, info = rollout(env, seed=3)
    assert episode.reward == sum(rewards.tolist())
    assert episode.jump_height == info["jump_height"] != 0.04
    assert episode.jump == info["jump"]
    assert episode.world == env.reset(seed=3)[1]["world"]


@pytest.mark.parametrize("controller", ["velocity", "torque"])
def test_the_policy_that_does_nothing_is_the_baseline_to_the_bit(controller):
    env = make_env(JumpConfig.of(controller=controller, **RANDOM))
    baseline = run_episode(env, 2)
    assert run_episode(env, 2, constant(0, 0, 0)) == baseline
    acted = run_episode(env, 2, FEEDBACK)
    assert acted.world == baseline.world
    assert acted.jump != baseline.jump


@pytest.mark.parametrize(("controller", "hold"), [("velocity", 2), ("torque", 5)])
def test_a_held_action_makes_the_traced_episode_the_plain_one(controller, hold):
    """To the bit, although the environment is stepped more often."""
    config = JumpConfig.of(controller=controller, **RANDOM)
    assert config.controls_per_step == hold
    plain, held = Watched(FEEDBACK), Watched(FEEDBACK)
    expected = run_episode(make_env(config), 2, plain)
    env = make_env(traced(config))
    episode = run_episode(env, 2, held, trace=True, hold=hold)
    assert untraced(episode) == untraced(expected)
    assert held.seen == plain.seen
    steps = len(episode.trace) - 1
    assert len(held.seen) == -(-steps // hold)
    assert len(set(held.seen)) > 20
    # Without holding the policy acts more often, which is another jump.
    assert untraced(run_episode(env, 2, FEEDBACK)) != untraced(expected)


def test_the_single_jump_is_the_same_with_and_without_figures():
    """For which the environment is stepped at the control rate."""
    config = JumpConfig.of(stand_time=0.1)
    console = Console(file=io.StringIO())
    plain, drawn = (
        run_nominal(config, 0, trace, console, Contender("feedback", FEEDBACK))
        for trace in (False, True)
    )
    for ours, theirs in zip(plain, drawn, strict=True):
        assert untraced(ours.episode) == untraced(theirs.episode)
        assert theirs.episode.trace
    assert plain[0].episode.jump != plain[1].episode.jump


def test_each_arm_is_repeated_with_slightly_other_masses(monkeypatch, quiet):
    monkeypatch.setattr("icub_jump_env.evaluation.modes.nominal.REPETITIONS", 3)
    config = JumpConfig.of(stand_time=0.1)
    arms = run_nominal(config, 4, False, quiet)
    for arm, posed in zip(arms, (True, False), strict=True):
        assert arm.config == config.replace(momentum_control=posed)
        env = make_env(perturbed(arm.config))
        assert list(arm.repeated) == [run_episode(env, seed) for seed in (4, 5, 6)]
        assert len({episode.jump["flight_height"] for episode in arm.repeated}) == 3
        assert set(arm.episode.world["link_mass"]) == {1.0}


def test_a_perturbed_jump_is_the_same_but_for_masses_within_a_thousandth():
    config = JumpConfig.of(controller="torque", actuators="realistic", jump_height=0.05)
    assert perturbed(config) == config.replace(
        randomization=Randomization(link_mass=(0.999, 1.001))
    )
    scales = make_env(perturbed(config)).reset(seed=3)[1]["world"]["link_mass"]
    assert len(set(scales)) > 10
    assert 0.999 <= min(scales) < 1.0 < max(scales) <= 1.001
