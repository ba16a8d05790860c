"""A critic that sees the world: the actor does not."""

import dataclasses
from functools import partial

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv
from tiny_run import PPO

from agents.environment import STATE, WORLD, LaunchEnv, acting_steps
from agents.options import TASK, TrainOptions
from agents.ppo import export, make_model

OPTIONS = TrainOptions(
    env=TASK.replace(stand_time=0.1), ppo=PPO, jobs=1, timesteps=1000, critic="world"
)


def make(hidden=(8,)):
    options = dataclasses.replace(OPTIONS, ppo=dataclasses.replace(PPO, hidden=hidden))
    env = DummyVecEnv([partial(LaunchEnv, options.env, options.input_names, options.axes, True)])
    return make_model(options, env), env


@pytest.mark.parametrize("hidden", [(8,), ()])
def test_the_critic_sees_all_and_the_actor_the_observation(rng, hidden):
    model, env = make(hidden)
    n, size = len(OPTIONS.input_names), env.observation_space.shape[0]
    assert size > n
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.copy_(torch.tensor(rng.normal(0, 0.5, parameter.shape)))
    seen = torch.tensor(rng.normal(size=(5, size)), dtype=torch.float32, requires_grad=True)
    actions, values, _ = model.policy(seen, deterministic=True)
    (of_actor,) = torch.autograd.grad(actions.sum(), seen, retain_graph=True)
    (of_critic,) = torch.autograd.grad(values.sum(), seen)
    assert not of_actor[:, n:].any()
    assert of_actor[:, :n].any(dim=0).all()
    assert of_critic.any(dim=0).all()

    policy = export(model, OPTIONS, 1.0)
    whole = seen.detach().numpy()
    theirs, _ = model.predict(whole, deterministic=True)
    ours = np.array([policy(each[:n]) for each in whole])
    rows = [OPTIONS.env.residual.axes.index(axis) for axis in OPTIONS.axes]
    np.testing.assert_allclose(ours[:, rows], theirs, atol=1e-6)


def test_it_learns():
    model, _ = make()
    before = [p.detach().clone() for p in model.policy.mlp_extractor.parameters()]
    model.learn(PPO.episodes * acting_steps(OPTIONS.env))
    after = list(model.policy.mlp_extractor.parameters())
    assert all(not torch.equal(a, b) for a, b in zip(before, after, strict=True))


def test_a_diverged_simulation_shows_it_nothing_that_is_not_finite():
    env = LaunchEnv(OPTIONS.env, OPTIONS.input_names, OPTIONS.axes, True)
    env.reset(seed=0)
    env.env.data.qvel[12] = np.nan
    seen, *_, info = env.step(np.zeros(2))
    assert info["diverged"]
    assert np.isfinite(seen).all()


def test_what_it_sees_is_the_world_and_the_true_state():
    n = len(OPTIONS.input_names)
    plain = LaunchEnv(OPTIONS.env, OPTIONS.input_names, OPTIONS.axes)
    env = LaunchEnv(OPTIONS.env, OPTIONS.input_names, OPTIONS.axes, True)
    for seed in (0, 1):
        seen, info = env.reset(seed=seed)
        np.testing.assert_array_equal(seen[:n], plain.reset(seed=seed)[0])
        world = np.concatenate([np.ravel(info["world"][k]) / s for k, s in WORLD.items()])
        np.testing.assert_allclose(seen[n : n + len(world)], world, rtol=1e-6)
        for _ in range(10):
            seen, *_ = env.step(np.array([0.5, 0.0]))
        state = dict(zip(STATE, np.split(seen[n + len(world) :], [3, 6, 9, 10]), strict=True))
        truth = env.env.snapshot()
        for name, shown in state.items():
            if name != "com":
                np.testing.assert_allclose(shown * STATE[name], getattr(truth, name), rtol=1e-5)
        assert 0.0 < np.linalg.norm(state["com"]) * STATE["com"] < 0.1
