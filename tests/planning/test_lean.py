"""What the IMU feels as a jump begins."""

import math

import numpy as np
import pytest

from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.planning.lean import lean_of
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
