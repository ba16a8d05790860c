"""A range of commands: each episode draws its own, and is the jump of that very command."""

import dataclasses
import json
import pickle

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, random_action, rollout
from gymnasium.utils.env_checker import check_env

from icub_jump_env import observation
from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ConfigError

LOW, HIGH = RANGE = (0.03, 0.07)
RANDOM = {"randomization": "hard", "sensors": "realistic", "stand_time": 0.1}


def commands(env, seeds):
    return [env.reset(seed=seed)[1]["jump_height"] for seed in seeds]


@pytest.fixture
def ranging():
    return ICubJumpEnv(jump_height=RANGE)


def test_commands_fill_the_range(ranging):
    drawn = commands(ranging, range(30))
    assert len(set(drawn)) == 30
    assert all(LOW <= height <= HIGH for height in drawn)
    thirds = {int((height - LOW) / (HIGH - LOW) * 3) for height in drawn}
    assert thirds == {0, 1, 2}
    assert np.mean(drawn) == pytest.approx(0.05, abs=0.005)


def test_a_seed_means_a_command_also_after_other_episodes(ranging):
    drawn = commands(ranging, (7, 8))
    ranging.step(ZERO)
    ranging.reset()
    assert commands(ranging, (8, 7)) == drawn[::-1]
    assert commands(ICubJumpEnv(jump_height=RANGE, **RANDOM), (7, 8)) == drawn


def test_resets_without_seed_go_on_to_new_commands(ranging):
    drawn = [*commands(ranging, (7,)), *commands(ranging, (None, None))]
    assert len(set(drawn)) == 3
    assert [*commands(ranging, (7,)), *commands(ranging, (None, None))] == drawn


def test_a_copy_goes_on_to_the_same_commands(ranging):
    ranging.reset(seed=7)
    twin = pickle.loads(pickle.dumps(ranging))
    assert commands(twin, (None, None)) == commands(ranging, (None, None))


def test_the_episode_is_that_of_the_same_command_given():
    """To the bit, with all that is random: the draw takes nothing from the world's stream."""
    ranging = ICubJumpEnv(jump_height=RANGE, **RANDOM)
    height, world = (ranging.reset(seed=5)[1][name] for name in ("jump_height", "world"))
    drawn = rollout(ranging, random_action, seed=5)
    given = {"jump_height": height}
    for env, options in (
        (ICubJumpEnv(**given, **RANDOM), None),
        (ICubJumpEnv(**RANDOM), given),
        (ranging, given),
    ):
        assert env.reset(seed=5, options=options)[1]["world"] == world
        again = rollout(env, random_action, seed=5, options=options)
        np.testing.assert_array_equal(again[0], drawn[0])
        np.testing.assert_array_equal(again[1], drawn[1])
        assert again[2] == drawn[2]
    other = rollout(ICubJumpEnv(**RANDOM), random_action, seed=5)
    assert not np.array_equal(other[0][:20], drawn[0][:20])


def test_a_range_of_no_width_is_its_command():
    env = ICubJumpEnv(jump_height=(0.05, 0.05))
    assert commands(env, range(3)) == [0.05] * 3


def test_info_observation_and_reward_go_by_the_command_drawn(ranging):
    scales = observation.DEFAULT.scales
    places = {name: observation.SLICES[name].start for name in ("jump_height", "takeoff_time")}
    for seed in (0, 1):
        obs, info = ranging.reset(seed=seed)
        height = info["jump_height"]
        assert type(height) is float
        seen = {name: obs[place] * scales[name] for name, place in places.items()}
        duration = 0.11 / (0.28867 * np.sqrt(2 * 9.81 * height))
        assert seen == pytest.approx({"jump_height": height, "takeoff_time": duration}, rel=1e-3)
        terminated = False
        while not terminated:
            obs, _, terminated, _, info = ranging.step(ZERO)
            assert info["jump_height"] == height
            assert obs[places["jump_height"]] * scales["jump_height"] == pytest.approx(height)
        off = abs(info["jump"]["flight_height"] - height) / height
        assert info["reward_height"] == pytest.approx(2.0 * (1.0 - off))


def test_success_is_judged_by_the_command_drawn(ranging):
    """The same rise is enough for the lower command, and too low for the higher one."""
    drawn = commands(ranging, range(10))
    for seed, success in ((np.argmin(drawn), True), (np.argmax(drawn), False)):
        ranging.reset(seed=seed)
        record = ranging._recorder.record
        record.landed, record.flight_time, record.flight_height = True, 0.2, 0.035
        assert ranging._info()["is_success"] is success


def test_an_option_may_be_a_range_and_holds_for_one_episode(env):
    height = env.reset(seed=1, options={"jump_height": RANGE})[1]["jump_height"]
    assert height == ICubJumpEnv(jump_height=RANGE).reset(seed=1)[1]["jump_height"]
    assert env.reset(seed=1)[1]["jump_height"] == 0.04


def test_vector_environments_draw_for_each():
    envs = gymnasium.make_vec(
        "ICubJump-v0", num_envs=2, vectorization_mode="sync", jump_height=RANGE
    )
    _, info = envs.reset(seed=[3, 4])
    single = gymnasium.make("ICubJump-v0", jump_height=RANGE)
    assert info["jump_height"].tolist() == commands(single, (3, 4))
    envs.close()


def test_checker_passes():
    check_env(ICubJumpEnv(jump_height=RANGE, stand_time=0.1), skip_render_check=True)


class TestConfiguration:
    def test_bounds(self):
        assert JumpConfig.of(jump_height=RANGE).jump_heights == RANGE
        assert JumpConfig.of(jump_height=0.05).jump_heights == (0.05, 0.05)

    def test_a_single_command_is_asked_for(self):
        assert JumpConfig.of(jump_height=0.05).commanded_height == 0.05
        with pytest.raises(ConfigError, match=r"jump_height=\(0\.03, 0\.07\) .* a single height"):
            _ = JumpConfig.of(jump_height=RANGE).commanded_height

    @pytest.mark.parametrize("heights", [list(RANGE), np.array(RANGE)])
    def test_lists_and_arrays_become_plain_and_come_back_from_json(self, heights):
        config = JumpConfig.of(jump_height=heights)
        assert config == JumpConfig.of(jump_height=RANGE)
        assert hash(config) == hash(JumpConfig.of(jump_height=RANGE))
        saved = json.loads(json.dumps(dataclasses.asdict(config)))
        assert JumpConfig.of(**saved) == config

    @pytest.mark.parametrize(
        ("heights", "words"),
        [
            ((0.07, 0.03), "the lower bound first"), ((0.03, 0.05, 0.07), "2 numbers"),
            ((0.03,), "2 numbers"), ((), "2 numbers"), ((0.03, 0.2), "0.01 to 0.15"),
            ((0.0, 0.05), "0.01 to 0.15"), ((0.03, np.nan), "2 numbers"),
            ((0.03, "high"), "2 numbers"), ((True, 0.05), "2 numbers"), ("ab", "a number"),
            ([[1], [1, 2]], "2 numbers"), ([[0.03, 0.07]], "2 numbers"), ({0.03, 0.07}, "a number"),
            (np.array(0.04), "2 numbers"), (np.array([[0.03, 0.07]]), "2 numbers"),
        ],
    )  # fmt: skip
    def test_refusals(self, env, heights, words):
        for refused in (
            lambda: JumpConfig.of(jump_height=heights),
            lambda: env.unwrapped.reset(options={"jump_height": heights}),
        ):
            with pytest.raises(ConfigError) as refusal:
                refused()
            assert refusal.value.field == "jump_height"
            assert repr(heights) in str(refusal.value)
            assert words in refusal.value.allowed

    def test_ragged_lists_are_refused_in_other_fields_as_well(self):
        with pytest.raises(ConfigError, match="residual_scale"):
            JumpConfig.of(residual_scale=[[1], [1, 2], 3])
        with pytest.raises(ConfigError, match="friction"):
            JumpConfig.of(randomization={"friction": [[1], [1, 2]]})

    @pytest.mark.parametrize("heights", [(0.03, 0.08), (0.08, 0.08)])
    def test_both_ends_must_be_reachable(self, heights):
        with pytest.raises(ConfigError, match=r"jump_height=0\.08 .*at most.*acceleration"):
            JumpConfig.of(jump_height=heights, com_scaling="acceleration")
        with pytest.raises(ConfigError, match=r"com_displacement=0\.03 .*for jump_height=0\.08"):
            JumpConfig.of(jump_height=heights, com_displacement=0.03)
