"""Several jumps in one episode: each from a new crouch, with its own clock and metrics."""

import functools
import math

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, rollout

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.jump import REST, SETTLING
from icub_jump_env.control.landing import CROUCH_TIME
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ConfigError
from icub_jump_env.observation import BLOCKS, SLICES

FEEDBACK = {"estimator": "imu", "flight": "feedback", "landing": "feedback"}
LANDINGS = {"hold": {}, "feedback": FEEDBACK}
WEIGHT = 324.3


def decoded(observation, name):
    scale = next(block.scale for block in BLOCKS if block.name == name)
    return observation[SLICES[name]] * scale


class Series:
    """An episode of two jumps, and what was seen at the start of the second."""

    def __init__(self, landing, controller):
        env = ICubJumpEnv(
            jumps=2, controller=controller, stand_time=0.3, **LANDINGS[landing]
        )  # fmt: skip
        env.reset(seed=0)
        self.observations, self.infos, self.rewards, self.forces, self.starts = [], [], [], [], []
        terminated = False
        begin = env._controller.start

        def start(plan, state, time, gravity, following=None):
            begin(plan, state, time, gravity, following)
            self.starts.append(time)
            self.speed = float(np.linalg.norm(state.com_velocity))
            self.sway = float(np.linalg.norm(state.angular_momentum))
            self.sole_heights = state.sole_position[:, 2].copy()
            self.crouch = np.abs(state.joint_position - plan.stance.posture)

        env._controller.start = start
        while not terminated:
            observation, reward, terminated, _, info = env.step(ZERO)
            self.observations.append(observation)
            self.infos.append(info)
            self.rewards.append(reward)
            self.forces.append(env._simulation.truth.state.ground_force)
        self.info = self.infos[-1]
        self.times = np.array([info["time"] for info in self.infos])


@functools.cache
def series(landing, controller):
    return Series(landing, controller)


@pytest.fixture(params=[(a, b) for a in LANDINGS for b in ("velocity", "torque")], ids="-".join)
def both(request):
    return series(*request.param)


class TestTwoJumps:
    def test_both_land(self, both):
        assert both.info["outcome"] == "stood"
        assert both.info["is_success"]
        together = both.info["series"]
        assert together["jumps"] == together["landed"] == 2
        assert together["jump_heights"] == (0.04, 0.04)

    def test_each_is_like_a_jump_by_itself(self, both):
        first, second = both.info["jumps"]
        assert both.info["jump"] == second
        assert second["flight_height"] == pytest.approx(first["flight_height"], abs=0.004)
        assert second["takeoff_time"] == pytest.approx(first["takeoff_time"], abs=0.01)
        assert second["flight_time"] == pytest.approx(first["flight_time"], abs=0.01)
        heights = [jump["flight_height"] for jump in both.info["jumps"]]
        assert both.info["series"]["mean_flight_height"] == pytest.approx(np.mean(heights))
        assert both.info["series"]["min_flight_height"] == min(heights)
        forces = [jump["landing_force"] for jump in both.info["jumps"]]
        assert both.info["series"]["landing_force"] == max(forces)
        assert np.abs(both.info["series"]["drift"]).max() < 0.08

    def test_the_second_begins_when_the_robot_has_stood_crouched_and_settled(self, both):
        (start,), first = both.starts, both.info["jumps"][0]
        touchdown = first["takeoff_time"] + first["flight_time"]
        expected = touchdown + REST + CROUCH_TIME + SETTLING
        assert start == pytest.approx(expected, abs=0.03)
        phases = [info["phase"] for info, t in zip(both.infos, both.times, strict=True)
                  if touchdown + 0.03 < t < start]  # fmt: skip
        assert set(phases) == {"landing"}
        assert both.infos[np.searchsorted(both.times, start + 0.005)]["phase"] == "launch"

    def test_it_begins_at_rest_in_the_crouch_on_both_feet(self, both):
        assert both.speed < 0.02
        assert both.sway < 0.1
        np.testing.assert_allclose(both.sole_heights, 0.0, atol=2e-3)
        # The arms may still be on their way: a saturated servo is slow.
        assert both.crouch[:15].max() < math.radians(6.0)

    def test_the_switch_to_the_launch_is_no_twitch(self, both):
        near = np.abs(both.times - both.starts[0]) < 0.04
        np.testing.assert_allclose(np.array(both.forces)[near], WEIGHT, rtol=0.05)

    def test_the_observation_tells_the_clock_of_the_present_jump(self, both):
        (start,) = both.starts
        for t, observation in zip(both.times, both.observations, strict=True):
            since = t - start if t >= start else t
            assert decoded(observation, "time")[0] == pytest.approx(since, abs=1e-5)
            progress = min(1.0, since / decoded(observation, "takeoff_time")[0])
            assert decoded(observation, "launch_progress")[0] == pytest.approx(progress, abs=1e-5)
        begun = np.searchsorted(both.times, start)
        assert np.abs(decoded(both.observations[begun], "com_offset")).max() < 1e-3

    def test_each_end_of_a_jump_is_paid(self, both):
        paid = [
            info["reward_landed"] + info["reward_height"] + info["reward_rotation"]
            for info in both.infos
        ]
        assert sum(x != 0.0 for x in paid) == 2
        assert paid[-1] != 0.0
        assert both.infos[int(np.flatnonzero(paid)[0])]["time"] == pytest.approx(
            both.starts[0], abs=0.011
        )
        assert sum(info["reward_landed"] for info in both.infos) == 2.0
        assert both.rewards == pytest.approx(paid)


def test_the_second_launch_may_fail():
    """Motors that can just hold the crouch: what counts is the deadline of that jump."""
    env = ICubJumpEnv(jumps=2, stand_time=0.3)
    env.reset(seed=0)
    terminated, start = False, None
    while not terminated:
        *_, terminated, _, info = env.step(ZERO)
        if start is None and info["series"]["jumps"] == 2:
            start = env.data.time
            holding = np.abs(env._controller.plan.stance.torque) + 1.0
            env._simulation.actuators.drives.effort[:] = holding
    assert info["outcome"] == "no take-off"
    assert info["time"] == pytest.approx(start + 0.43 + 0.5, abs=0.02)
    assert info["series"]["landed"] == 1
    assert math.isnan(info["jump"]["takeoff_time"])
    assert not info["is_success"]


def test_a_landing_that_goes_unnoticed_does_not_last_for_ever():
    env = ICubJumpEnv(jumps=2)
    env.reset(seed=0)
    env._controller._crouches = math.inf
    env._controller._following = None
    *_, info = finish(env)
    assert info["outcome"] == "no take-off"
    landed = info["jump"]["takeoff_time"] + info["jump"]["flight_time"]
    assert info["time"] == pytest.approx(landed + 3.0, abs=0.02)
    assert not info["is_success"]


def finish(env, action=ZERO):
    terminated = False
    while not terminated:
        *result, terminated, _, info = env.step(action)
    return *result, info


class TestCommands:
    def test_one_for_each_jump(self):
        env = ICubJumpEnv(jumps=3, stand_time=0.1)
        env.reset(seed=0, options={"jump_heights": [0.03, 0.05, 0.04]})
        *_, info = finish(env)
        assert info["is_success"]
        assert info["series"]["jump_heights"] == (0.03, 0.05, 0.04)
        assert info["jump_height"] == 0.04
        for jump, height in zip(info["jumps"], (0.03, 0.05, 0.04), strict=True):
            assert jump["flight_height"] == pytest.approx(height, abs=0.006)

    def test_a_range_draws_one_for_each_and_the_first_as_ever(self):
        single = ICubJumpEnv(jump_height=(0.03, 0.07))
        several = ICubJumpEnv(jump_height=(0.03, 0.07), jumps=4)
        first, info = single.reset(seed=7)
        again, same = several.reset(seed=7)
        np.testing.assert_array_equal(again, first)
        assert same["jump_height"] == info["jump_height"]
        assert same["world"] == info["world"]
        assert len(set(several._heights)) == 4

    def test_a_single_one_holds_for_all(self):
        env = ICubJumpEnv(jumps=3)
        env.reset(seed=0, options={"jump_height": 0.05})
        assert env._heights == (0.05,) * 3

    @pytest.mark.parametrize(
        "heights", [[0.04], [0.04] * 3, [0.04, 0.3], 0.04, [0.04, math.nan], "ab", None]
    )
    def test_refused_heights(self, heights):
        with pytest.raises(ConfigError, match="jump_heights"):
            ICubJumpEnv(jumps=2).reset(options={"jump_heights": heights})

    def test_a_height_without_a_plan_is_refused(self):
        env = ICubJumpEnv(jumps=2, jump_height=0.04, com_displacement=0.05)
        with pytest.raises(ConfigError, match="com_displacement"):
            env.reset(options={"jump_heights": [0.04, 0.12]})

    def test_either_one_or_one_for_each(self):
        with pytest.raises(ConfigError, match="options"):
            ICubJumpEnv(jumps=2).reset(options={"jump_height": 0.04, "jump_heights": [0.04, 0.05]})

    @pytest.mark.parametrize("jumps", [0, 101, 1.5, True, "2", None])
    def test_refused_numbers_of_jumps(self, jumps):
        with pytest.raises(ConfigError, match="jumps"):
            JumpConfig(jumps=jumps)


def test_a_single_jump_says_what_it_always_said():
    env = ICubJumpEnv(stand_time=0.1)
    _, info = env.reset(seed=0)
    names = {
        "jump", "is_success", "outcome", "diverged", "phase", "time", "jump_height",
        "solver_status", "solver_primal_residual", "solver_dual_residual", "solver_gap",
    }  # fmt: skip
    assert set(info) == names | {"world", "sensor_errors"}
    terms = {"reward_landed", "reward_height", "reward_rotation", "reward_residual"}
    assert set(env.step(ZERO)[4]) == names | terms


def test_the_residual_acts_in_each_launch_from_rest():
    env = ICubJumpEnv(jumps=2, stand_time=0.1)
    env.reset(seed=0)
    action, charged, offsets = np.array([0.0, 0.0, 0.2], np.float32), [], []
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step(action)
        charged.append(info["reward_residual"] < 0.0)
        offsets.append(env._controller.residual.offset[2])
    begins = np.flatnonzero(np.diff(charged, prepend=False))
    assert len(begins) == 4  # on and off, twice
    assert info["series"]["landed"] == 2
    assert abs(offsets[begins[2] - 1]) < 1e-4


def test_same_seed_same_bits():
    env = gymnasium.make("ICubJump-v0", jumps=2, stand_time=0.1, randomization="full", **FEEDBACK)
    once, again = rollout(env, seed=1), rollout(env, seed=1)
    np.testing.assert_array_equal(once[0], again[0])
    assert once[2] == again[2]


def test_a_push_in_the_launch_comes_once():
    env = ICubJumpEnv(jumps=2, stand_time=0.1, randomization={"push": (2.0, 2.0)})
    env.reset(seed=0)
    pushed, terminated = [], False
    while not terminated:
        *_, terminated, _, info = env.step(ZERO)
        pushed.append((info["series"]["jumps"], bool(env._simulation.physics.chest_force.any())))
    assert (1, True) in pushed
    assert (2, True) not in pushed
