"""What an agent sees: every block of the observation against an independent source."""

import math

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, random_action, rollout

from icub_jump_env import observation


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
    crouch = env.robot.crouch
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


def test_no_privileged_state_in_the_observation():
    """Where the robot is in the world is nothing its sensors tell."""
    observations = []
    for shift in (0.0, 3.0):
        env = gymnasium.make("ICubJump-v0").unwrapped
        env._planner.plan(0.04).stance.configuration[:2] += shift
        obs, _ = env.reset(seed=0)
        for _ in range(30):
            obs, *_ = env.step(ZERO)
        observations.append(obs)
        assert env.data.qpos[0] == pytest.approx(shift, abs=0.2)
        env.close()
    np.testing.assert_allclose(*observations, atol=1e-4)


def test_the_com_error_is_zero_after_the_launch():
    """The reference ends with the launch; what was left of the error must not stay."""
    env = gymnasium.make("ICubJump-v0", stand_time=0.1).unwrapped
    env.reset(seed=0)
    seen, terminated = {"launch": [], "flight": [], "landing": []}, False
    while not terminated:
        obs, _, terminated, _, info = env.step(np.full(3, 0.1, np.float32))
        seen[info["phase"]].append(decoded(obs)["com_error"])
    assert np.abs(seen["launch"][-1]).max() > 1e-4
    for phase in ("flight", "landing"):
        assert len(seen[phase]) > 5
        assert not np.any(seen[phase])
