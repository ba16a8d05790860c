"""The environment as its users meet it: how it starts, what it pays and tells, what actions do."""

import gc
import warnings
import weakref

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, random_action, rollout
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

import icub_jump_env
from icub_jump_env import observation
from icub_jump_env.control.phases import Phase
from icub_jump_env.control.qp.problem import QPStatus


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


def test_option_overrides_one_episode(env):
    _, info = env.reset(seed=0, options={"jump_height": 0.02})
    assert info["jump_height"] == 0.02
    _, info = env.reset(seed=0)
    assert info["jump_height"] == 0.04


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


def test_reward_of_a_success(env):
    _, rewards, info = rollout(env)
    assert rewards.sum() == pytest.approx(
        1.0 + 2.0 * (1.0 - abs(info["jump"]["flight_height"] / 0.04 - 1.0))
        - abs(info["jump"]["flight_rotation"])
    )  # fmt: skip


def test_residual_cost_charges_for_the_action(env):
    env.reset(seed=0)
    *_, info = env.step(np.array([0.5, -0.5, 1.0], np.float32))
    assert info["reward_residual"] == pytest.approx(-0.001 * 1.5)


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
            "self_collisions", "still_time",
        }  # fmt: skip


def test_solver_failures_are_counted_and_shown():
    """Every other tick fails: the step's info shows the failure, not the success after it."""
    env = gymnasium.make("ICubJump-v0").unwrapped
    checked = env._controller._controllers[Phase.LAUNCH]._controller.qp._solver
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
    assert 0.5 * 0.4 * env.config.residual.scale[axis] < shift


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


def test_forces_enter_through_ctrl_alone(env):
    env.reset(seed=0)
    data, limit = env.unwrapped.data, env.unwrapped.model.actuator_ctrlrange[:, 1]
    for _ in range(60):
        env.step(ZERO)
        assert not data.qfrc_applied.any()
        assert not data.xfrc_applied.any()
        assert (np.abs(data.ctrl) <= limit).all()
        np.testing.assert_array_equal(data.actuator_force, data.ctrl)


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


def test_vector_environments():
    envs = gymnasium.make_vec("ICubJump-v0", num_envs=2, vectorization_mode="sync", stand_time=0.1)
    envs.reset(seed=0)
    for _ in range(75):
        obs, *_ = envs.step(np.zeros((2, 3), np.float32))
    np.testing.assert_array_equal(obs[0], obs[1])
    envs.close()


def test_nothing_keeps_an_environment_alive():
    """Neither a cache nor a reference of MuJoCo's or Pinocchio's objects."""
    env = gymnasium.make("ICubJump-v0")
    env.reset(seed=0)
    env.step(ZERO)
    jump = env.unwrapped
    parts = [weakref.ref(part) for part in (jump, jump.model, jump.data)]
    env.close()
    del env, jump
    gc.collect()
    assert [part() for part in parts] == [None] * 3
