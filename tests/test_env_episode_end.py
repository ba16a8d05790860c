"""How an episode ends: standing, fallen or still on the ground, and each for its own reason."""

import math

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, rollout


def test_stands_for_the_stand_time(env):
    *_, info = rollout(env)
    assert info["outcome"] == "stood"
    jump = info["jump"]
    stood = info["time"] - jump["takeoff_time"] - jump["flight_time"]
    assert stood == pytest.approx(0.3, abs=0.011)
    assert info["is_success"]


def test_a_touch_of_anything_but_the_soles_is_a_fall():
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


def test_a_tilt_of_more_than_60_degrees_is_a_fall():
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


def test_fall_ends_it():
    *_, info = rollout(gymnasium.make("ICubJump-v0", momentum_control=False))
    assert info["outcome"] == "fell"
    assert not info["is_success"]
    assert not info["jump"]["landed"]


def test_no_take_off_ends_it():
    """Motors that can just hold the crouch never leave the ground."""
    env = gymnasium.make("ICubJump-v0").unwrapped
    holding = np.abs(env._planner.plan(0.04).stance.torque) + 1.0
    env._simulation.actuators.drives.effort[:] = holding
    *_, info = rollout(env)
    assert info["outcome"] == "no take-off"
    assert info["time"] == pytest.approx(0.43 + 0.5, abs=0.011)
    assert math.isnan(info["jump"]["takeoff_time"])
    assert info["jump"]["flight_height"] == 0.0


def test_stepping_on_after_the_end_changes_and_pays_nothing(env):
    *_, info = rollout(env.unwrapped)
    _, reward, terminated, _, again = env.unwrapped.step(ZERO)
    assert terminated
    assert reward == 0.0
    assert again["jump"] == info["jump"]


@pytest.mark.parametrize("timestep", [1e-3, 1e-4])
def test_without_stand_time_the_jump_still_happens(timestep):
    *_, info = rollout(gymnasium.make("ICubJump-v0", stand_time=0.0, timestep=timestep))
    assert info["outcome"] == "stood"
    assert info["jump"]["flight_height"] > 0.035


def test_a_residual_that_leans_in_the_launch_can_still_land():
    env = gymnasium.make("ICubJump-v0", stand_time=0.5).unwrapped
    env.reset(seed=0)
    terminated, tilt = False, 0.0
    while not terminated:
        action = [0.3, 0, -1] if env.data.time < 0.1 else ZERO
        _, _, terminated, _, info = env.step(action)
        tilt = max(tilt, env._simulation.truth.state.chest_tilt)
    assert math.degrees(tilt) > 30.0
    assert info["is_success"]
