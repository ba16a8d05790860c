"""The environment as its users meet it."""

import copy
import gc
import math
import pickle
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import psutil
import pytest
from conftest import ZERO, random_action, rollout
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

import icub_jump_env
from icub_jump_env import observation
from icub_jump_env.control.qp import QPStatus


@pytest.mark.parametrize("name", ["ICubJump-v0", "icub_jump_env:ICubJump-v0"])
def test_both_names_make_it(name):
    env = gymnasium.make(name)
    assert env.unwrapped.config == icub_jump_env.JumpConfig()
    env.close()


def test_gymnasium_checker_passes_without_warnings():
    env = gymnasium.make("ICubJump-v0", stand_time=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()


def test_stable_baselines3_checker_passes_without_warnings():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gymnasium.make("ICubJump-v0", stand_time=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(env.unwrapped, warn=True)
    env.close()


def test_spaces_and_timing(env):
    assert env.action_space == gymnasium.spaces.Box(-1, 1, (3,), np.float32)
    assert env.observation_space.shape == (observation.SIZE,)
    assert env.unwrapped.dt == pytest.approx(0.01)
    assert env.unwrapped.model.opt.timestep == 0.001
    env.reset(seed=0)
    env.step(ZERO)
    assert env.unwrapped.data.time == pytest.approx(0.01)


def test_starts_at_rest_in_the_crouch(env):
    env.reset(seed=0)
    data = env.unwrapped.data
    assert data.time == 0.0
    assert not data.qvel.any()
    assert np.abs(data.qacc).max() < 0.1
    assert data.sensor("floor_force").data[3] == pytest.approx(324.3, rel=1e-3)
    for _ in range(10):  # the reference hardly moves in the first 0.1 s
        env.step(ZERO)
    assert np.abs(data.qvel[:3]).max() < 0.05


def test_world_frame(env):
    env.reset(seed=0)
    data = env.unwrapped.data
    left, right = data.body("l_sole").xpos, data.body("r_sole").xpos
    assert left[1] > 0.05
    assert right[1] < -0.05
    np.testing.assert_allclose((left + right)[:2] / 2, 0.0, atol=1e-3)
    toes = data.body("l_sole").xmat.reshape(3, 3) @ [1, 0, 0]
    np.testing.assert_allclose(toes, [1, 0, 0], atol=1e-3)


def test_reward_is_the_sum_of_its_terms(env):
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, reward, terminated, _, info = env.step(random_action(rng))
        terms = {k: v for k, v in info.items() if k.startswith("reward_")}
        assert set(terms) == {
            "reward_landed",
            "reward_height",
            "reward_rotation",
            "reward_residual",
        }
        assert reward == sum(terms.values())


def test_info_of_every_step(env):
    env.reset(seed=0)
    for _ in range(20):
        *_, info = env.step(ZERO)
        assert isinstance(info["is_success"], bool)
        assert info["outcome"] == "running"
        assert set(info["jump"]) == {
            "takeoff_time", "takeoff_velocity", "ballistic_height", "flight_time",
            "sole_slip", "chest_lean",
            "flight_height", "apex_height", "sole_height", "flight_rotation",
            "base_pitch_range", "angular_momentum_takeoff", "peak_ground_force", "landed",
            "solver_failures", "limit_violations", "landing_force", "joint_work",
        }  # fmt: skip


def test_observations_are_finite_and_inside_the_space(env):
    for seed in range(3):
        observations, _, _ = rollout(env, random_action, seed)
        assert np.isfinite(observations).all()
        assert all(env.observation_space.contains(obs) for obs in observations)


def test_observations_are_sensibly_scaled(env):
    observations, _, _ = rollout(env)
    moving = observations.std(axis=0) > 1e-6
    assert moving.sum() > 50
    assert np.median(np.abs(observations[:, moving]).max(axis=0)) > 0.02
    clipped = (np.abs(observations) == observation.OBSERVATION_LIMIT).mean(axis=0)
    assert clipped.max() < 0.05


def test_observation_layout():
    covered = np.zeros(observation.SIZE, dtype=int)
    for block in observation.BLOCKS:
        covered[observation.SLICES[block.name]] += 1
    assert (covered == 1).all()
    assert observation.layout_table().count("\n") == observation.SIZE + 1


def test_observation_values(env):
    obs, _ = env.reset(seed=0, options={"jump_height": 0.05})
    slices = observation.SLICES
    np.testing.assert_array_equal(obs[slices["phase"]], [1, 0, 0])
    assert obs[slices["jump_height"]] == pytest.approx(1.0)
    assert obs[slices["com_displacement"]] == pytest.approx(1.1)
    assert np.abs(obs[slices["joint_position"]]).max() < 0.01
    assert obs[slices["foot_force"]].sum() * 300 == pytest.approx(324.3, rel=1e-2)


def decoded(obs):
    """Blocks of an observation in SI units."""
    return {
        block.name: obs[observation.SLICES[block.name]].astype(float) * block.scale
        for block in observation.BLOCKS
    }


def test_observation_against_the_simulator_in_mid_launch():
    """Every block against an independent source: MuJoCo's state, the clock, the snapshot."""
    env = gymnasium.make("ICubJump-v0", jump_height=0.05).unwrapped
    env.reset(seed=0)
    start = env.snapshot().com
    for _ in range(30):
        obs, *_ = env.step(np.array([0.1, -0.1, 0.1], np.float32))
    block, data, now = decoded(obs), env.data, env.snapshot()
    crouch = env._crouch
    assert block["time"] == pytest.approx(0.30)
    duration = block["takeoff_time"]
    assert duration == pytest.approx(0.11 / (0.28867 * math.sqrt(2 * 9.81 * 0.05)), rel=1e-3)
    assert block["launch_progress"] == pytest.approx(0.30 / duration)
    np.testing.assert_allclose(block["joint_position"], data.qpos[7:] - crouch, atol=1e-6)
    np.testing.assert_allclose(block["joint_velocity"], data.qvel[6:], atol=1e-5)
    imu = data.site("imu").xmat.reshape(3, 3)
    np.testing.assert_allclose(block["gravity"], imu.T @ [0, 0, -1], atol=1e-6)
    world_gyro = data.body("root_link").xmat.reshape(3, 3) @ data.qvel[3:6]
    np.testing.assert_allclose(imu @ block["gyro"], world_gyro, atol=5e-3)
    assert np.abs(world_gyro[1]) > 0.1
    # The feet have hardly moved, so that the estimates are close to the truth.
    np.testing.assert_allclose(block["com_offset"], now.com - start, atol=2e-3)
    np.testing.assert_allclose(block["com_velocity"], now.com_velocity, atol=0.03)
    H = data.sensor("angular_momentum").data
    np.testing.assert_allclose(block["angular_momentum"], H, atol=0.05)
    np.testing.assert_allclose(
        block["com_error"], block["com_offset"] + env._start_com - now.com_reference, atol=1e-5
    )
    assert block["residual_offset"] == pytest.approx([0.006, -0.002, 0.002], rel=0.1)
    assert np.abs(block["residual_velocity"]).max() < 0.01
    feet = [data.sensor(f"{side}_sole_force").data[3] for side in "lr"]
    np.testing.assert_allclose(block["foot_force"], feet, rtol=1e-5)
    assert feet[0] != pytest.approx(feet[1], rel=1e-3)  # the lateral residual loads one foot
    env.close()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_axis_of_the_action_moves_the_com_its_way(axis, sign):
    action, coms = np.zeros(3, np.float32), []
    action[axis] = 0.4 * sign
    for residual in (ZERO, action):
        env = gymnasium.make("ICubJump-v0").unwrapped
        env.reset(seed=0)
        for _ in range(30):
            env.step(residual)
        coms.append(env.snapshot().com)
        env.close()
    shift = sign * (coms[1] - coms[0])[axis]
    assert 0.5 * 0.4 * env.config.residual_scale[axis] < shift


def test_no_privileged_state_in_the_observation():
    """Where the robot is in the world is nothing its sensors tell."""
    observations = []
    for shift in (0.0, 3.0):
        env = gymnasium.make("ICubJump-v0").unwrapped
        env._crouch_qpos[:2] += shift
        obs, _ = env.reset(seed=0)
        for _ in range(30):
            obs, *_ = env.step(ZERO)
        observations.append(obs)
        assert env.data.qpos[0] == pytest.approx(shift, abs=0.2)
        env.close()
    np.testing.assert_allclose(*observations, atol=1e-4)


def test_forces_enter_through_ctrl_alone(env):
    env.reset(seed=0)
    data, limit = env.unwrapped.data, env.unwrapped.model.actuator_ctrlrange[:, 1]
    for _ in range(60):
        env.step(ZERO)
        assert not data.qfrc_applied.any()
        assert not data.xfrc_applied.any()
        assert (np.abs(data.ctrl) <= limit).all()
        np.testing.assert_array_equal(data.actuator_force, data.ctrl)


class TestDeterminism:
    def test_same_seed_same_bits_also_after_dirty_episodes(self, env):
        fresh = rollout(env, random_action, seed=3)
        rollout(env, random_action, seed=4)
        env.reset(seed=5)
        for _ in range(47):
            env.step(np.ones(3, np.float32))
        again = rollout(env, random_action, seed=3)
        np.testing.assert_array_equal(again[0], fresh[0])
        np.testing.assert_array_equal(again[1], fresh[1])
        assert again[2] == fresh[2]

    @pytest.mark.parametrize("solver", ["daqp", "osqp"])
    def test_same_bits_in_another_process(self, solver):
        program = (
            "import gymnasium, icub_jump_env, numpy as np, hashlib\n"
            f"env = gymnasium.make('ICubJump-v0', stand_time=0.1, solver={solver!r})\n"
            "env.reset(seed=0); h = hashlib.sha256(); done = False\n"
            "while not done:\n"
            "    obs, r, done, _, info = env.step(np.full(3, 0.1, np.float32))\n"
            "    h.update(obs.tobytes()); h.update(env.unwrapped.data.qpos.tobytes())\n"
            "print(h.hexdigest())\n"
        )
        digests = {
            subprocess.run(
                [sys.executable, "-c", program], check=True, capture_output=True, text=True
            ).stdout
            for _ in range(2)
        }
        assert len(digests) == 1

    def test_interleaved_environments_do_not_disturb_each_other(self):
        alone = rollout(gymnasium.make("ICubJump-v0", stand_time=0.1), random_action, 1)
        envs = [gymnasium.make("ICubJump-v0", stand_time=0.1, jump_height=h) for h in (0.04, 0.06)]
        rngs = [np.random.default_rng(1), np.random.default_rng(2)]
        observations = [envs[0].reset(seed=1)[0]]
        envs[1].reset(seed=2)
        done = [False, False]
        while not done[0]:
            for i in range(2):
                if not done[i]:
                    obs, _, done[i], _, _ = envs[i].step(random_action(rngs[i]))
                    if i == 0:
                        observations.append(obs)
        np.testing.assert_array_equal(np.array(observations), alone[0])

    def test_stepping_at_the_control_rate_changes_nothing(self):
        """An agent at 200 Hz with zero actions sees the trajectory of one at 100 Hz."""
        states = []
        for frequency in (100.0, 200.0):
            env = gymnasium.make("ICubJump-v0", agent_frequency=frequency).unwrapped
            env.reset(seed=0)
            for _ in range(round(0.6 * frequency)):
                env.step(ZERO)
            states.append(np.concatenate((env.data.qpos, env.data.qvel)))
            env.close()
        np.testing.assert_array_equal(*states)

    def test_zero_residual_is_the_baseline(self, env):
        """Whatever the residual scale: the zero action leaves the reference untouched."""
        wide = gymnasium.make("ICubJump-v0", stand_time=0.3, residual_scale=(0.1, 0.1, 0.1))
        none = gymnasium.make("ICubJump-v0", stand_time=0.3, residual_scale=(0.0, 0.0, 0.0))
        states = []
        for candidate, action in ((wide, ZERO), (none, np.ones(3, np.float32)), (env, -ZERO)):
            candidate.reset(seed=0)
            for _ in range(70):
                candidate.step(action)
            states.append(candidate.unwrapped.data.qpos.copy())
        np.testing.assert_array_equal(states[0], states[1])
        np.testing.assert_array_equal(states[0], states[2])


def test_residual_moves_the_com_forward():
    shifts = []
    for forward in (0.0, 0.4):
        env = gymnasium.make("ICubJump-v0").unwrapped
        env.reset(seed=0)
        for _ in range(35):
            env.step(np.array([forward, 0, 0], np.float32))
        shifts.append(env.snapshot().com[0])
        env.close()
    assert 0.02 < shifts[1] - shifts[0] < 0.04  # asked for: 0.4 x 6 cm


@pytest.mark.parametrize("copier", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("steps", [0, 20, 50, 70])
def test_a_copy_continues_bit_for_bit(copier, steps):
    env = gymnasium.make("ICubJump-v0", stand_time=0.2)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(random_action(rng))
    twin = copier(env)
    assert twin.unwrapped.data is not env.unwrapped.data
    terminated = False
    while not terminated:
        action = random_action(rng)
        results = [e.step(action) for e in (env, twin)]
        np.testing.assert_array_equal(results[0][0], results[1][0])
        assert results[0][1] == results[1][1]
        terminated = results[0][2]
    assert str(results[0][4]) == str(results[1][4])
    np.testing.assert_array_equal(env.unwrapped.data.qpos, twin.unwrapped.data.qpos)


def test_many_environments_leak_nothing():
    def churn(count):
        for _ in range(count):
            env = gymnasium.make("ICubJump-v0")
            env.reset(seed=0)
            env.step(ZERO)
            env.close()
        gc.collect()
        return psutil.Process().memory_info().rss

    start = churn(30)
    assert churn(1000) - start < 20e6


def test_vector_environments():
    envs = gymnasium.make_vec("ICubJump-v0", num_envs=2, vectorization_mode="sync", stand_time=0.1)
    envs.reset(seed=0)
    for _ in range(75):
        obs, *_ = envs.step(np.zeros((2, 3), np.float32))
    np.testing.assert_array_equal(obs[0], obs[1])
    envs.close()


class TestEpisodeEnd:
    def test_stands_for_the_stand_time(self, env):
        *_, info = rollout(env)
        assert info["outcome"] == "stood"
        jump = info["jump"]
        stood = info["time"] - jump["takeoff_time"] - jump["flight_time"]
        assert stood == pytest.approx(0.3, abs=0.011)
        assert info["is_success"]

    def test_a_touch_of_anything_but_the_soles_is_a_fall(self):
        """A shin box that has grown to the length of the leg touches at once."""
        env = gymnasium.make("ICubJump-v0").unwrapped
        env.reset(seed=0)
        shin = env.model.geom("l_lower_leg_contact").id
        env.model.geom_size[shin] = 0.25
        env.model.geom_rbound[shin] = 0.5
        env.model.geom_aabb[shin, 3:] = 0.25
        *_, terminated, _, info = env.step(ZERO)
        assert terminated
        assert info["outcome"] == "fell"
        assert env._simulation.truth.state.chest_tilt < math.radians(40)

    def test_a_tilt_of_more_than_60_degrees_is_a_fall(self):
        """Without contact: the robot turns in the air."""
        env = gymnasium.make("ICubJump-v0").unwrapped
        env.reset(seed=0)
        env.data.qpos[2] += 3.0
        env.data.qvel[4] = -6.0
        terminated = False
        while not terminated:
            *_, terminated, _, info = env.step(ZERO)
        assert info["outcome"] == "fell"
        assert env._simulation.truth.state.only_feet_touch
        assert math.degrees(env._simulation.truth.state.chest_tilt) == pytest.approx(60.0, abs=1.5)

    def test_fall_ends_it(self):
        *_, info = rollout(gymnasium.make("ICubJump-v0", momentum_control=False))
        assert info["outcome"] == "fell"
        assert not info["is_success"]
        assert not info["jump"]["landed"]

    def test_no_take_off_ends_it(self):
        """Motors that can just hold the crouch never leave the ground."""
        env = gymnasium.make("ICubJump-v0").unwrapped
        env._simulation.actuators._motor._effort = np.abs(env._crouch_torque) + 1.0
        *_, info = rollout(env)
        assert info["outcome"] == "no take-off"
        assert info["time"] == pytest.approx(0.43 + 0.5, abs=0.011)
        assert math.isnan(info["jump"]["takeoff_time"])
        assert info["jump"]["flight_height"] == 0.0

    def test_reward_of_a_success(self, env):
        _, rewards, info = rollout(env)
        assert rewards.sum() == pytest.approx(
            1.0 + 2.0 * (1.0 - abs(info["jump"]["flight_height"] / 0.04 - 1.0))
            - abs(info["jump"]["flight_rotation"])
        )  # fmt: skip

    def test_stepping_on_after_the_end_changes_and_pays_nothing(self, env):
        *_, info = rollout(env.unwrapped)
        _, reward, terminated, _, again = env.unwrapped.step(ZERO)
        assert terminated
        assert reward == 0.0
        assert again["jump"] == info["jump"]

    @pytest.mark.parametrize("timestep", [1e-3, 1e-4])
    def test_without_stand_time_the_jump_still_happens(self, timestep):
        *_, info = rollout(gymnasium.make("ICubJump-v0", stand_time=0.0, timestep=timestep))
        assert info["outcome"] == "stood"
        assert info["jump"]["flight_height"] > 0.035

    def test_a_residual_that_leans_in_the_launch_can_still_land(self):
        env = gymnasium.make("ICubJump-v0", stand_time=0.5).unwrapped
        env.reset(seed=0)
        terminated, tilt = False, 0.0
        while not terminated:
            action = [0.3, 0, -1] if env.data.time < 0.1 else ZERO
            _, _, terminated, _, info = env.step(action)
            tilt = max(tilt, env._simulation.truth.state.chest_tilt)
        assert math.degrees(tilt) > 30.0
        assert info["is_success"]

    def test_option_overrides_one_episode(self, env):
        _, info = env.reset(seed=0, options={"jump_height": 0.02})
        assert info["jump_height"] == 0.02
        _, info = env.reset(seed=0)
        assert info["jump_height"] == 0.04


def test_solver_failures_are_counted_and_shown():
    """Every other tick fails: the step's info shows the failure, not the success after it."""
    env = gymnasium.make("ICubJump-v0").unwrapped
    checked = env._controller._launch._solver
    solve, ticks = checked.solve, iter(range(1000))

    def flaky():
        solution, report = solve()
        status = QPStatus.REJECTED if next(ticks) % 2 == 0 else report.status
        return solution, report._replace(status=status)

    checked.solve = flaky
    env.reset(seed=0)
    for step in range(10):
        *_, info = env.step(ZERO)
        assert info["jump"]["solver_failures"] == step + 1
        assert info["solver_status"] == "rejected"
        assert 0 < info["solver_dual_residual"] < 1e-8
    env.close()


def test_residual_cost_charges_for_the_action(env):
    env.reset(seed=0)
    *_, info = env.step(np.array([0.5, -0.5, 1.0], np.float32))
    assert info["reward_residual"] == pytest.approx(-0.001 * 1.5)


@settings(max_examples=10)
@given(st.integers(0, 2**31 - 1))
def test_any_actions_keep_the_promises(seed):
    """Whatever the agent does: finite observations, limits, no solver surprises."""
    env = gymnasium.make("ICubJump-v0", stand_time=0.1, residual_scale=(0.1, 0.1, 0.1))
    observations, rewards, info = rollout(env, random_action, seed)
    env.close()
    assert np.isfinite(observations).all()
    assert np.isfinite(rewards).all()
    assert info["outcome"] in ("stood", "fell", "no take-off")
    assert len(rewards) < 400
