"""PPO starts at the baseline, and what is exported acts as what was trained."""

import dataclasses
from contextlib import closing
from functools import partial

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv
from tiny_run import PPO

from agents.checkpoints import segment_seeds
from agents.environment import LaunchEnv, acting_steps
from agents.options import TASK, TrainOptions
from agents.ppo import (
    LEAST_SPREAD,
    WHITENING_EPISODES,
    export,
    freeze_policy,
    make_model,
    set_noise,
    whiten,
)
from agents.vec_env import JumpVecEnv
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.residual import COM_AXES as AXES

OPTIONS = TrainOptions(env=TASK.replace(stand_time=0.1), ppo=PPO, jobs=1, timesteps=1000)
ROLLOUT = 2 * acting_steps(OPTIONS.env)


def make(**changes):
    options = dataclasses.replace(OPTIONS, **changes)
    env = DummyVecEnv([partial(LaunchEnv, options.env, options.input_names, options.axes)])
    return options, make_model(options, env)


def weights(model):
    """Bytes of the weights, of the policy and of the value function; and of the noise."""
    parts = {
        "policy": (model.policy.mlp_extractor.policy_net, model.policy.action_net),
        "value": (model.policy.mlp_extractor.value_net, model.policy.value_net),
    }
    found = {
        name: b"".join(p.detach().numpy().tobytes() for part in pair for p in part.parameters())
        for name, pair in parts.items()
    }
    return found | {"noise": model.policy.log_std.detach().numpy().tobytes()}


def changed(model, before):
    after = weights(model)
    return {name for name in after if after[name] != before[name]}


@pytest.mark.parametrize("hidden", [(8,), (), (5, 3)])
def test_the_mean_action_is_zero_at_the_start(rng, hidden):
    options, model = make(ppo=dataclasses.replace(PPO, hidden=hidden))
    observations = rng.uniform(-10, 10, (50, 80)).astype(np.float32)
    actions, _ = model.predict(observations, deterministic=True)
    assert not actions.any()
    policy = export(model, options, 1.0)
    assert policy.hidden == hidden
    assert not any(policy(observation).any() for observation in observations)
    values = model.policy.predict_values(torch.tensor(observations))
    assert values.unique().numel() > 1  # the value function is not zeroed


def test_learning_spares_the_frozen_policy_and_always_the_noise():
    _, model = make()
    torch.nn.init.normal_(model.policy.action_net.weight)  # all layers would learn
    before = weights(model)
    freeze_policy(model, True)
    model.learn(ROLLOUT)
    assert changed(model, before) == {"value"}
    before = weights(model)
    freeze_policy(model, False)
    model.learn(ROLLOUT)
    assert changed(model, before) == {"policy", "value"}


def test_the_noise_follows_its_schedule():
    options, model = make(ppo=dataclasses.replace(PPO, log_std=(-1.0, -2.0)))
    for steps, expected in ((0, -1.0), (250, -1.25), (1000, -2.0), (1500, -2.0)):
        model.num_timesteps = steps
        assert np.log(set_noise(model, options)) == pytest.approx(expected)
        np.testing.assert_allclose(model.policy.log_std.detach(), expected, rtol=0, atol=1e-6)


def test_the_noise_of_an_episode_is_one_multiple_of_the_hidden_layer_and_another_in_the_next():
    options, model = make()
    rollouts = []

    def watch(local, _):
        buffer = local["rollout_buffer"]
        if buffer.pos == buffer.buffer_size - 1:  # the step that ends it is yet to be written
            seen = torch.tensor(buffer.observations[:-1, 0])
            actions = torch.tensor(buffer.actions[:-1, 0])
            with torch.no_grad():
                mean = model.policy.get_distribution(seen).mode()
                features = model.policy.features_extractor(seen)
                hidden = model.policy.mlp_extractor.forward_actor(features)
            rollouts.append((hidden.numpy(), (actions - mean).numpy()))
        return True

    set_noise(model, options)
    model.learn(ROLLOUT, callback=watch)
    ((hidden, noise),) = rollouts
    length = acting_steps(options.env)

    def misfit(steps):
        multiple = np.linalg.lstsq(hidden[steps], noise[steps], rcond=None)[0]
        return np.abs(noise[steps] - hidden[steps] @ multiple).max()

    first, second = slice(0, length), slice(length, None)
    assert misfit(first) < 1e-4
    assert misfit(second) < 1e-4
    assert misfit(slice(None)) > 1e-2


@pytest.mark.parametrize("hidden", [(8,), ()])
def test_observations_of_the_baseline_get_mean_zero_and_deviation_one(hidden):
    """And the noise of its actions is as large as it should be."""
    ppo = dataclasses.replace(PPO, hidden=hidden, log_std=(-1.5, -1.5))
    options = dataclasses.replace(OPTIONS, ppo=ppo, jobs=2)
    make = partial(LaunchEnv, options.env, options.input_names, options.axes)
    with closing(JumpVecEnv([make] * 2)) as env:
        model = make_model(options, env)
        whiten(model, options)
        env.reset_all(segment_seeds(options.seed, 0, 2))
        still = np.zeros((2, 2), np.float32)
        steps = WHITENING_EPISODES * acting_steps(options.env)
        seen = np.concatenate([env.step(still)[0] for _ in range(steps)])
    white = model.policy.features_extractor(torch.tensor(seen)).numpy()
    assert np.abs(white.mean(axis=0)).max() < 1e-3
    varies = seen.std(axis=0) > LEAST_SPREAD
    assert 10 < varies.sum() < 80
    np.testing.assert_allclose(white[:, varies].std(axis=0), 1.0, rtol=0, atol=1e-2)
    assert white[:, ~varies].std(axis=0).max() < LEAST_SPREAD
    set_noise(model, options)
    with torch.no_grad():
        noise = model.policy.get_distribution(torch.tensor(seen)).distribution.stddev
    assert noise.square().mean().sqrt().log().item() == pytest.approx(-1.5, abs=1e-3)


@pytest.mark.parametrize(
    ("inputs", "axes"),
    [("all", AXES), ("command", ("vertical",)), ("all", ("forward", "vertical"))],
)
def test_the_exported_policy_acts_as_the_model(rng, inputs, axes):
    """On the whole observation, on all axes, and with actions of the scale; no torch."""
    options, model = make(inputs=inputs, axes=axes)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.copy_(torch.tensor(rng.normal(0, 0.5, parameter.shape)))
    names = list(DEFAULT.scales)
    columns = [names.index(name) for name in options.input_names]
    rows = [AXES.index(axis) for axis in axes]
    observations = rng.uniform(-2, 2, (200, 80)).astype(np.float32)
    model.policy.features_extractor.measure(torch.tensor(observations[:, columns]))
    policy = export(model, options, 0.5)
    ours = np.array([policy(observation) for observation in observations])
    theirs, _ = model.predict(observations[:, columns], deterministic=True)
    assert 0 < (np.abs(theirs) == 1).mean() < 1  # some are clipped, not all
    np.testing.assert_allclose(ours[:, rows], 0.5 * theirs, rtol=0, atol=1e-6)
    assert not np.delete(ours, rows, axis=1).any()
    assert ours.dtype == np.float32

    with torch.no_grad():  # learning goes on; what was exported stays
        model.policy.action_net.weight.zero_()
    assert np.array_equal(policy(observations[0]), ours[0])


def test_a_jump_of_the_exported_policy_is_the_one_trained_on(rng):
    """What the environment makes of the model's actions, and the plain one of the policy's."""
    options, model = make(axes=("vertical",))
    torch.nn.init.normal_(model.policy.action_net.weight)
    (env,) = model.get_env().envs
    env.scale_actions(0.5)
    policy = export(model, options, 0.5)
    observation, _ = env.reset(seed=5)
    plain = make_env(options.env)
    whole, _ = plain.reset(seed=5)
    offset, offsets = list(DEFAULT.scales).index("residual_offset.z"), []
    for _ in range(acting_steps(options.env) - 1):
        np.testing.assert_allclose(observation, whole, rtol=0, atol=1e-4)
        observation, *_ = env.step(model.predict(observation, deterministic=True)[0])
        whole, *_ = plain.step(policy(whole))
        offsets.append(abs(whole[offset]))
    assert max(offsets) > 0.01


def test_rewards_are_discounted_by_gamma_and_lambda():
    """From the rewards of a rollout alone: the value function is set to zero."""
    options, model = make(ppo=dataclasses.replace(PPO, gamma=0.5, gae_lambda=0.75))
    buffer = model.rollout_buffer
    buffer.rewards[:] = np.arange(buffer.buffer_size)[:, None]
    buffer.values[:], buffer.episode_starts[:] = 0.0, 0.0
    buffer.compute_returns_and_advantage(torch.zeros(1), np.array([True]))
    share = options.ppo.gamma * options.ppo.gae_lambda
    expected = 0.0
    for step in reversed(range(buffer.buffer_size)):
        expected = step + share * expected
        assert buffer.returns[step, 0] == pytest.approx(expected)
    # Of the value of the state after a step, gamma alone counts.
    buffer.rewards[:], buffer.values[:] = 0.0, 1.0
    buffer.compute_returns_and_advantage(torch.ones(1), np.array([False]))
    assert buffer.advantages[-1, 0] == pytest.approx(options.ppo.gamma - 1.0)
    assert model.gamma == options.ppo.gamma  # as for episodes that are cut off
