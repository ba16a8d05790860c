"""What the IMU feels as a jump begins."""

import math

import numpy as np
import pytest

from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.planning.lean import MOMENTUM_PER_LEAN, lean_of
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.versions import VERSIONS

SLOPE = math.radians(3.0)


def felt(**config):
    env = ICubJumpEnv(**config)
    env.reset(seed=0)
    return lean_of(env._simulation.sensors.readings.gravity, env._controller.plan.stance)


@pytest.mark.parametrize("name", sorted(VERSIONS))
def test_on_level_ground_there_is_none(name):
    np.testing.assert_allclose(felt(**VERSIONS[name]), 0.0, atol=2e-3)


@pytest.mark.parametrize(("slope", "axis"), [("slope", 0), ("lateral_slope", 1)])
def test_it_is_the_slope_of_the_ground(slope, axis):
    """Uphill ahead the robot leans back, and gravity points backward in its frame."""
    lean = felt(randomization=Randomization(**{slope: (SLOPE, SLOPE)}))
    assert lean[axis] == pytest.approx(-SLOPE, rel=0.15)
    assert abs(lean[1 - axis]) < 3e-3


def test_the_correction_turns_the_robot_back_by_half_of_the_lean():
    """As one rigid body, within the time of a flight: docs/controller.md."""
    robot, inertia = load_robot(), []
    kinematics = FeetFixedKinematics(robot)
    for posture in (robot.crouch, robot.landing):
        kinematics.update(posture)
        inertia.append(kinematics.A_base[4, 4])
    np.testing.assert_allclose(inertia, [1.36, 1.80], rtol=0.05)
    for_all_of_it = np.array(inertia) / (0.2, 0.1)
    np.testing.assert_allclose(for_all_of_it, [7.0, 18.0], rtol=0.05)
    assert pytest.approx(for_all_of_it.mean() / 2, rel=0.1) == MOMENTUM_PER_LEAN
