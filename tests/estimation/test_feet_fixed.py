"""What the paper's estimator says beside CoM and momentum, by finite differences."""

import numpy as np
import pinocchio as pin
import pytest
from motions import BOTH, ROBOT, MadeUp

from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.robot.kinematics import FeetFixedKinematics


@pytest.fixture
def motion(rng):
    speed = 0.4 * rng.normal(size=ROBOT.n_joints)
    return MadeUp(lambda t: ROBOT.crouch + t * speed)


@pytest.fixture
def kinematics():
    return FeetFixedKinematics(ROBOT)


def test_angular_velocity_is_that_of_the_base(motion, kinematics):
    estimator, e = FeetFixedEstimator(kinematics), 1e-5
    before, after = motion.base(0.1 - e)[0], motion.base(0.1 + e)[0]
    state = estimator.estimate(motion.readings(0.1))
    expected = pin.log3(after @ before.T) / (2 * e)
    assert np.linalg.norm(expected) > 0.1
    np.testing.assert_allclose(state.angular_velocity, expected, atol=1e-7)


def test_com_velocity_is_the_derivative_of_the_com(motion, kinematics):
    estimator, e = FeetFixedEstimator(kinematics), 1e-5
    ends = [estimator.estimate(motion.readings(0.1 + way)).com.copy() for way in (-e, e)]
    state = estimator.estimate(motion.readings(0.1))
    np.testing.assert_allclose(state.com_velocity, (ends[1] - ends[0]) / (2 * e), atol=1e-7)


def test_soles_are_on_the_floor_where_the_model_has_them(motion, kinematics):
    state = FeetFixedEstimator(kinematics).estimate(motion.readings(0.0, BOTH))
    for sole, ankle, point in zip(
        state.sole_position, kinematics.base_M_ankles, kinematics.ankle_p_soles, strict=True
    ):
        placed = state.base_rotation @ ankle.act(point) + kinematics.base_position
        # The crouch has the right one 0.1 mm too low.
        np.testing.assert_allclose(sole, placed, atol=2e-4)
    assert state.sole_position[0, 1] > 0.05
    np.testing.assert_allclose(state.sole_position[:, 2], 0.0, atol=1e-12)
    np.testing.assert_array_equal(state.foot_force, BOTH)


def test_gravity_is_down_on_any_floor(motion, kinematics):
    state = FeetFixedEstimator(kinematics).estimate(motion.readings(0.1))
    np.testing.assert_array_equal(state.gravity, [0.0, 0.0, -1.0])
