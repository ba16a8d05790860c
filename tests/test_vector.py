"""Environments side by side: the bits of single ones, whatever thread steps them."""

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import gymnasium
import numpy as np
import pytest
from conftest import HARD, random_action, rollout
from gymnasium.vector import AutoresetMode

from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ActionError, ConfigError, UnknownFieldError
from icub_jump_env.vector import ICubJumpVectorEnv

QUICK = {"randomization": "hard", "stand_time": 0.0}
STRONGEST = {"controller": "torque", "jump_height": (0.03, 0.06), **HARD}
N = 3


@pytest.fixture
def racing(monkeypatch):
    """More threads than this machine may have cores, and they interrupt each other all the time."""
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


@pytest.fixture
def make():
    """Makes vector environments and closes them."""
    made = []

    def make_vec(name="ICubJump-v0", num_envs=N, **config):
        mode = config.pop("vectorization_mode", "vector_entry_point")
        made.append(gymnasium.make_vec(name, num_envs=num_envs, vectorization_mode=mode, **config))
        return made[-1]

    yield make_vec
    for envs in made:
        envs.close()


def actions(steps, num_envs=N):
    return np.random.default_rng(0).uniform(-1.2, 1.2, (steps, num_envs, 3)).astype(np.float32)


def steps_of(envs, steps):
    """Whatever a vector environment returns."""
    return [plain(envs.step(action)) for action in actions(steps, envs.num_envs)]


def plain(value):
    """Lists in place of arrays of objects, which NumPy does not compare when they are arrays."""
    if isinstance(value, dict):
        return {name: plain(entry) for name, entry in value.items()}
    if isinstance(value, tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [plain(entry) for entry in value]
    return value


def one_alone(env, seed, own_actions):
    """Observation, reward and whether the episode ended, of a single environment."""
    results, over = [(env.reset(seed=seed)[0], 0.0, False)], False
    for action in own_actions:
        if over:
            results.append((env.reset()[0], 0.0, False))
        else:
            results.append(env.step(action)[:3])
        over = results[-1][2]
    return results


class TestSameBits:
    @pytest.mark.parametrize(
        ("name", "config", "steps"), [("ICubJump-v0", QUICK, 160), ("ICubJump-v1", STRONGEST, 130)]
    )
    def test_as_single_environments(self, make, racing, name, config, steps):
        envs = make(name, **config)
        alone = gymnasium.make(name, **config)
        start = envs.reset(seed=7)[0]
        results = steps_of(envs, steps)
        ends = 0
        for i in range(N):
            expected = one_alone(alone, 7 + i, actions(steps)[:, i])
            np.testing.assert_array_equal(start[i], expected[0][0])
            for result, (observation, reward, over) in zip(results, expected[1:], strict=True):
                np.testing.assert_array_equal(result[0][i], observation)
                assert (result[1][i], result[2][i], result[3][i]) == (reward, over, False)
                ends += over
        assert ends >= N

    @pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
    def test_as_gymnasiums_vector_environment_with_all_info(self, make, racing, mode):
        ours = make(autoreset_mode=mode, max_episode_steps=60, **QUICK)
        theirs = make(
            vectorization_mode="sync",
            vector_kwargs={"autoreset_mode": AutoresetMode(mode)},
            max_episode_steps=60,
            **QUICK,
        )
        np.testing.assert_equal(ours.reset(seed=[5, 3, 9]), theirs.reset(seed=[5, 3, 9]))
        results, expected = steps_of(ours, 90), steps_of(theirs, 90)
        np.testing.assert_equal(results, expected)
        assert sum(result[3].sum() for result in results) == N
        resets = [result[4] for result in results if "world" in result[4]]
        assert len(resets) == 1
        assert ("final_obs" in resets[0]) == (mode == "SameStep")

    def test_whatever_their_order(self, make):
        seeds, order = [4, 8, 2], [2, 0, 1]
        straight, permuted = make(**QUICK), make(**QUICK)
        straight.reset(seed=seeds)
        permuted.reset(seed=[seeds[i] for i in order])
        for action in actions(80):
            result, other = straight.step(action), permuted.step(action[order])
            for ours, theirs in zip(result[:4], other[:4], strict=True):
                np.testing.assert_array_equal(ours[order], theirs)

    @pytest.mark.parametrize("steps", [10, 20])
    def test_a_reset_of_some(self, make, steps):
        """While they jump, and when all have just ended."""
        ours = make(max_episode_steps=20, **QUICK)
        theirs = make(vectorization_mode="sync", max_episode_steps=20, **QUICK)
        for envs in (ours, theirs):
            envs.reset(seed=0)
            for action in actions(steps):
                envs.step(action)
            envs.reset(seed=3, options={"reset_mask": np.array([True, False, True])})
        np.testing.assert_equal(steps_of(ours, 25), steps_of(theirs, 25))

    def test_environments_of_any_kind_share_nothing(self, racing):
        """Solvers, models and buffers of one are none of another's."""
        kinds = [
            {"solver": "osqp", "stand_time": 0.0},
            {"controller": "torque", "planner": "whole_body", **HARD},
            {"estimator": "imu", "flight": "feedback", "landing": "feedback", **HARD},
            {"jumps": 2, "stand_time": 0.0, "self_collision": True},
            {"physics_loop": "python", "robot": "iCubGenova02", "stand_time": 0.0},
        ]

        def played(config):
            return rollout(ICubJumpEnv(**config), random_action, seed=1)

        expected = [played(config) for config in kinds]
        with ThreadPoolExecutor(4) as threads:
            results = list(threads.map(played, kinds))
        np.testing.assert_equal(results, expected)


class TestGymnasium:
    def test_it_is_what_make_vec_makes(self):
        for name in ("ICubJump-v0", "ICubJump-v1"):
            envs = gymnasium.make_vec(name, num_envs=2)
            assert isinstance(envs, ICubJumpVectorEnv)
            assert envs.spec.id == name
            assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
            assert envs.get_attr("dt") == (0.01, 0.01)
            estimators = {
                env.config.estimator for env in envs.call("get_wrapper_attr", "unwrapped")
            }
            assert estimators == {"imu" if name == "ICubJump-v1" else "feet_fixed"}
            envs.close()

    def test_spaces(self, make):
        envs, single = make(), ICubJumpEnv()
        assert envs.single_observation_space == single.observation_space
        assert envs.single_action_space == single.action_space
        assert envs.action_space.shape == (N, 3)
        assert envs.reset(seed=0)[0] in envs.observation_space
        assert envs.step(envs.action_space.sample())[0] in envs.observation_space

    def test_options_are_for_all(self, make):
        envs = make()
        info = envs.reset(seed=0, options={"jump_height": 0.05})[1]
        assert info["jump_height"].tolist() == [0.05] * N

    def test_pictures_are_those_of_single_environments(self, make):
        config = {"render_mode": "rgb_array", "width": 64, "height": 48, **QUICK}
        envs, alone = make(num_envs=2, **config), gymnasium.make("ICubJump-v0", **config)
        envs.reset(seed=0)
        for action in actions(10, 2):
            envs.step(action)
        for i, picture in enumerate(envs.render()):
            one_alone(alone, i, actions(10, 2)[:, i])
            np.testing.assert_array_equal(picture, alone.render())
        alone.close()

    def test_closing_ends_the_threads(self, make):
        before = threading.active_count()
        envs = make()
        envs.reset(seed=0)
        envs.step(actions(1)[0])
        envs.close()
        envs.close()
        assert threading.active_count() == before


class TestErrors:
    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("num_envs", 0),
            ("num_envs", 1.5),
            ("max_episode_steps", 0),
            ("autoreset_mode", "Disabled"),
            ("autoreset_mode", None),
            ("render_mode", "human"),
            ("jump_height", 3.0),
        ],
    )
    def test_a_bad_argument_is_named(self, field, value):
        with pytest.raises(ConfigError) as error:
            gymnasium.make_vec("ICubJump-v0", **{"num_envs": 2, field: value})
        assert (error.value.field, error.value.value) == (field, value)

    def test_an_unknown_argument(self):
        with pytest.raises(UnknownFieldError, match="jump_hight"):
            gymnasium.make_vec("ICubJump-v0", num_envs=2, jump_hight=0.05)

    def test_a_step_comes_after_a_reset(self, make):
        envs = make()
        with pytest.raises(gymnasium.error.ResetNeeded):
            envs.step(actions(1)[0])
        with pytest.raises(ConfigError, match="seed"):
            envs.reset(seed=-1)

    @pytest.mark.parametrize(
        "bad", [np.zeros((2, 3)), np.zeros((N, 2)), np.full((N, 3), np.nan), [[0, 0, 0]] * 4]
    )
    def test_a_bad_action_moves_nobody(self, make, bad):
        envs, undisturbed = make(**QUICK), make(**QUICK)
        for vector in (envs, undisturbed):
            vector.reset(seed=1)
            vector.step(actions(1)[0])
        with pytest.raises(ActionError):
            envs.step(bad)
        np.testing.assert_equal(steps_of(envs, 3), steps_of(undisturbed, 3))

    @pytest.mark.parametrize("broken", range(N))
    def test_after_an_error_all_is_well_from_the_next_reset_on(self, make, monkeypatch, broken):
        envs, undisturbed = make(**QUICK), make(**QUICK)
        envs.reset(seed=1)
        with monkeypatch.context() as patch:
            jump = envs.envs[broken].unwrapped

            def fail(action):
                raise RuntimeError("broken")

            patch.setattr(jump, "step", fail)
            for _ in range(2):
                with pytest.raises(RuntimeError, match="broken"):
                    envs.step(actions(1)[0])
        np.testing.assert_equal(envs.reset(seed=2), undisturbed.reset(seed=2))
        np.testing.assert_equal(steps_of(envs, 3), steps_of(undisturbed, 3))
