"""Inverse kinematics of the legs in the air, against Pinocchio's frames."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.soles import LIMIT_MARGIN, LegKinematics

ROBOT = load_robot()
LEGS = LegKinematics(ROBOT)


def soles_of(posture, robot=ROBOT):
    """Middles of the soles from the CoM, and their orientations, base frame."""
    model = build_pinocchio_model(robot)
    data = model.createData()
    q = pin.neutral(model)
    q[7:] = posture
    com = pin.centerOfMass(model, data, q).copy()
    pin.framesForwardKinematics(model, data, q)
    frames = [data.oMf[model.getFrameId(name)] for name in robot.sole_frames]
    middle = np.array([robot.sole.center_x, 0.0, robot.sole.bottom])
    return np.array([f.act(middle) - com for f in frames]), np.array([f.rotation for f in frames])


@pytest.mark.parametrize("name", ["iCubGazeboV2_7", "iCubGenova02"])
@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_steps_converge_to_soles_that_can_be_reached(name, seed):
    robot = load_robot(name)
    legs, rng = LegKinematics(robot), np.random.default_rng(seed)
    # Forward the ankles would have to bend beyond their limit.
    shift = rng.uniform([-0.05, -0.02, -0.03], [0.0, 0.02, 0.02])
    turn = pin.exp3(rng.uniform(-0.15, 0.15, 3) * [0.3, 1.0, 0.3])
    soles, orientations = soles_of(robot.landing, robot)
    posture, errors = robot.landing.copy(), []
    for _ in range(12):
        posture[legs.joints] = legs.step(posture, soles + shift, turn @ orientations[0])
        now, turned = soles_of(posture, robot)
        errors.append(np.abs(now - soles - shift).max())
    assert errors[-1] < 1e-5
    assert errors[3] < 0.1 * errors[0] + 1e-6
    for orientation in turned:
        np.testing.assert_allclose(orientation, turn @ orientations[0], atol=1e-4)
    still = np.delete(np.arange(robot.n_joints), np.arange(12))
    np.testing.assert_array_equal(posture[still], robot.landing[still])


def test_out_of_reach_the_legs_stay_within_their_limits_and_steps_are_bounded():
    soles, orientations = soles_of(ROBOT.landing)
    posture = ROBOT.landing.copy()
    for _ in range(30):
        before = posture[LEGS.joints].copy()
        posture[LEGS.joints] = LEGS.step(posture, soles + [0.4, 0.0, -0.3], orientations[0])
        assert np.abs(posture[LEGS.joints] - before).max() <= 0.15 + 1e-12
        assert np.isfinite(posture).all()
    assert (posture >= ROBOT.lower_position + LIMIT_MARGIN - 1e-12)[LEGS.joints].all()
    assert (posture <= ROBOT.upper_position - LIMIT_MARGIN + 1e-12)[LEGS.joints].all()


def test_a_copy_does_the_same():
    copy = pickle.loads(pickle.dumps(LEGS))
    soles, orientations = soles_of(ROBOT.landing)
    steps = [legs.step(ROBOT.landing, soles + 0.01, orientations[0]) for legs in (LEGS, copy)]
    np.testing.assert_array_equal(*steps)


def test_the_chest_points_up_where_the_robot_stands_upright():
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(np.zeros(ROBOT.n_joints))
    np.testing.assert_allclose(
        kinematics.base_rotation @ kinematics.chest_up(), [0, 0, 1], atol=1e-3
    )
    kinematics.update(ROBOT.landing)  # which leans forward
    x, y, z = kinematics.base_rotation @ kinematics.chest_up()
    assert np.degrees(np.arctan2(x, z)) == pytest.approx(19.1, abs=1.0)
    assert abs(y) < 1e-3
