"""Feet-fixed kinematics against the full floating-base model."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.statics import make_stance

ROBOT = load_robot()

model = build_pinocchio_model(ROBOT)


def floating_base(kinematics, s):
    """Pinocchio configuration with the base where the feet-fixed kinematics puts it."""
    quaternion = pin.Quaternion(kinematics.base_rotation).coeffs()
    return np.concatenate((kinematics.base_position, quaternion, s))


def foot_jacobian(q, frame):
    data = model.createData()
    return pin.computeFrameJacobian(
        model, data, q, model.getFrameId(frame), pin.LOCAL_WORLD_ALIGNED
    )


@given(st.integers(0, 10_000))
def test_maps_equal_the_floating_base_model_with_the_left_foot_at_rest(seed):
    rng = np.random.default_rng(seed)
    s = ROBOT.crouch + 0.2 * rng.normal(size=ROBOT.n_joints)
    s_dot = rng.normal(size=ROBOT.n_joints)
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(s)
    q = floating_base(kinematics, s)

    J_left = foot_jacobian(q, "l_sole")
    base = -np.linalg.solve(J_left[:, :6], J_left[:, 6:] @ s_dot)
    nu = np.concatenate((base, s_dot))
    data = model.createData()
    np.testing.assert_allclose(kinematics.com, pin.centerOfMass(model, data, q), atol=1e-12)
    momentum = pin.computeCentroidalMomentum(model, data, q, nu)
    np.testing.assert_allclose(
        kinematics.J_com @ s_dot, momentum.linear / kinematics.mass, atol=1e-10
    )
    np.testing.assert_allclose(kinematics.J_momentum @ s_dot, momentum.angular, atol=1e-10)


@given(st.integers(0, 10_000))
def test_feet_constraint_vanishes_exactly_when_both_feet_are_at_rest(seed):
    rng = np.random.default_rng(seed)
    s = ROBOT.crouch + 0.1 * rng.normal(size=ROBOT.n_joints)
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(s)
    q = floating_base(kinematics, s)
    J = np.vstack([foot_jacobian(q, frame) for frame in ROBOT.sole_frames])
    _, _, Vt = np.linalg.svd(J)
    at_rest = Vt[12:].T @ rng.normal(size=17)
    assert np.abs(kinematics.J_feet @ at_rest[6:]).max() < 1e-10
    moving = at_rest + Vt[:12].T @ rng.normal(size=12)
    left_at_rest = moving[6:]
    right_velocity = J[6:] @ np.concatenate(
        (-np.linalg.solve(J[:6, :6], J[:6, 6:] @ left_at_rest), left_at_rest)
    )
    assert (np.abs(right_velocity).max() < 1e-6) == (
        np.abs(kinematics.J_feet @ left_at_rest).max() < 1e-6
    )


def test_com_jacobian_is_the_derivative_of_the_com(rng):
    kinematics = FeetFixedKinematics(ROBOT)
    s, step = ROBOT.crouch.copy(), 1e-6
    kinematics.update(s)
    J = kinematics.J_com.copy()
    direction = rng.normal(size=ROBOT.n_joints)
    ends = []
    for sign in (1, -1):
        kinematics.update(s + sign * step * direction)
        ends.append(kinematics.com.copy())
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), J @ direction, atol=1e-7)


def test_sole_stays_flat_on_the_floor(rng):
    kinematics = FeetFixedKinematics(ROBOT)
    s = ROBOT.crouch + 0.2 * rng.normal(size=ROBOT.n_joints)
    kinematics.update(s)
    data = model.createData()
    pin.framesForwardKinematics(model, data, floating_base(kinematics, s))
    left = data.oMf[model.getFrameId("l_sole")]
    np.testing.assert_allclose(left.rotation, np.eye(3), atol=1e-12)
    assert left.translation[2] + ROBOT.sole.bottom == pytest.approx(0.0, abs=1e-12)
    assert left.translation[1] > 0


def test_robot_faces_forward():
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(np.zeros(ROBOT.n_joints))
    np.testing.assert_allclose(kinematics.base_rotation @ [-1, 0, 0], [1, 0, 0], atol=1e-12)


def test_the_torques_of_a_stance_balance_gravity():
    kinematics = FeetFixedKinematics(ROBOT)
    posture, q, torque = make_stance(kinematics, ROBOT.crouch)
    np.testing.assert_array_equal(posture, ROBOT.crouch)
    np.testing.assert_allclose(q, floating_base(kinematics, ROBOT.crouch), atol=1e-12)
    gravity = pin.computeGeneralizedGravity(model, model.createData(), q)
    J = np.vstack([foot_jacobian(q, frame) for frame in ROBOT.sole_frames])
    residual = gravity - np.concatenate((np.zeros(6), torque))
    wrenches, *_ = np.linalg.lstsq(J.T, residual, rcond=None)
    np.testing.assert_allclose(J.T @ wrenches, residual, atol=1e-9)
    vertical = wrenches[2] + wrenches[8]
    assert vertical == pytest.approx(kinematics.mass * 9.81, rel=1e-9)
    assert (np.abs(torque) < ROBOT.effort_limit).all()


def test_com_shift_moves_the_com_and_neither_foot():
    kinematics = FeetFixedKinematics(ROBOT)
    shift = kinematics.com_shift(ROBOT.landing)
    assert kinematics.J_feet @ shift == pytest.approx(np.zeros((6, 3)), abs=1e-12)
    com, step = kinematics.com.copy(), 1e-6
    for axis in range(3):
        kinematics.update(ROBOT.landing + step * shift[:, axis])
        assert (kinematics.com - com) / step == pytest.approx(np.eye(3)[axis], abs=1e-4)


def test_com_shift_is_the_shortest():
    kinematics = FeetFixedKinematics(ROBOT)
    shift = kinematics.com_shift(ROBOT.landing)
    rows = np.vstack((kinematics.J_feet, kinematics.J_com))
    # The shortest solution of linear equations has no part in their null space.
    assert rows.T @ np.linalg.lstsq(rows.T, shift)[0] == pytest.approx(shift, abs=1e-12)
