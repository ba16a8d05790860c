"""Equations of motion on fixed feet against Pinocchio's inverse dynamics."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()

model = build_pinocchio_model(ROBOT)
damping = np.array(model.damping[6:])


class Random:
    """A random state and (s_ddot, f), in our form and in Pinocchio's floating-base model."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        n = ROBOT.n_joints
        self.s = ROBOT.crouch + 0.1 * rng.normal(size=n)
        self.s_dot = rng.normal(size=n)
        self.kinematics = FeetFixedKinematics(ROBOT)
        self.dynamics = FeetFixedDynamics(self.kinematics)
        self.kinematics.update(self.s)
        self.dynamics.update(self.s, self.s_dot)
        self.x = np.concatenate((rng.normal(size=n), 20 * rng.normal(size=12)))
        self.s_ddot, self.f = self.x[:n], self.x[n:]

        quaternion = pin.Quaternion(self.kinematics.base_rotation).coeffs()
        self.q = np.concatenate((self.kinematics.base_position, quaternion, self.s))
        self.soles = [model.getFrameId(frame) for frame in ROBOT.sole_frames]
        self.J = [
            pin.computeFrameJacobian(model, model.createData(), self.q, i) for i in self.soles
        ]
        left = self.J[0]
        self.nu = self.with_base(self.s_dot, left[:, 6:] @ self.s_dot)
        data = model.createData()
        pin.forwardKinematics(model, data, self.q, self.nu, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        self.drift = [pin.getFrameAcceleration(model, data, i).vector for i in self.soles]
        self.nu_dot = self.with_base(self.s_ddot, left[:, 6:] @ self.s_ddot + self.drift[0])
        self.placements = [data.oMf[i].copy() for i in self.soles]

    def with_base(self, joints, left_foot):
        """Complete joint rates with the base's that keep the left foot at rest."""
        return np.concatenate((-np.linalg.solve(self.J[0][:, :6], left_foot), joints))


@given(st.integers(0, 10_000))
def test_rows_equal_inverse_dynamics(seed):
    state = Random(seed)
    forces = pin.rnea(model, model.createData(), state.q, state.nu, state.nu_dot)
    for J, wrench in zip(state.J, (state.f[:6], state.f[6:]), strict=True):
        forces -= J.T @ wrench
    forces[6:] += damping * state.s_dot
    ours = state.dynamics
    np.testing.assert_allclose(ours.base_rows @ state.x - ours.base_bias, forces[:6], atol=1e-9)
    np.testing.assert_allclose(
        ours.torque_rows @ state.x + ours.torque_bias, forces[6:], atol=1e-9
    )


@given(st.integers(0, 10_000))
def test_foot_bias_is_the_drift_of_the_right_foot(seed):
    state = Random(seed)
    right = state.J[1] @ state.nu_dot + state.drift[1]
    base = pin.SE3(state.kinematics.base_rotation, state.kinematics.base_position)
    to_base = base.actInv(state.placements[1]).toActionMatrix()
    relative = state.kinematics.J_feet @ state.s_ddot - state.dynamics.foot_bias
    np.testing.assert_allclose(to_base @ right, -relative, atol=1e-9)


@given(st.integers(0, 10_000))
def test_force_and_moment_rows_sum_the_contacts(seed):
    state = Random(seed)
    com = pin.centerOfMass(model, model.createData(), state.q)
    total = np.zeros(6)
    for placement, wrench in zip(state.placements, (state.f[:6], state.f[6:]), strict=True):
        force = placement.rotation @ wrench[:3]
        moment = placement.rotation @ wrench[3:]
        total[:3] += force
        total[3:] += moment + np.cross(placement.translation - com, force)
    R = state.kinematics.base_rotation
    np.testing.assert_allclose(R @ (state.dynamics.force_rows @ state.f), total[:3], atol=1e-9)
    np.testing.assert_allclose(R @ (state.dynamics.moment_rows @ state.f), total[3:], atol=1e-9)


def test_momentum_balance(rng):
    """Newton and Euler: with the feet at rest, the contact forces change the momentum."""
    state = Random(3)
    ours, n = state.dynamics, ROBOT.n_joints
    # Wrenches that satisfy the base rows for the given joint accelerations.
    rows, bias = ours.base_rows, ours.base_bias
    f, *_ = np.linalg.lstsq(rows[:, n:], bias - rows[:, :n] @ state.s_ddot, rcond=None)
    data = model.createData()
    pin.computeCentroidalMomentumTimeVariation(model, data, state.q, state.nu, state.nu_dot)
    R, mass = state.kinematics.base_rotation, state.kinematics.mass
    weight = np.array([0, 0, -9.81 * mass])
    np.testing.assert_allclose(R @ (ours.force_rows @ f) + weight, data.dhg.linear, atol=1e-8)
    np.testing.assert_allclose(R @ (ours.moment_rows @ f), data.dhg.angular, atol=1e-8)


def test_shared_model_keeps_its_gravity():
    Random(0)
    assert build_pinocchio_model(ROBOT).gravity.linear == pytest.approx([0, 0, -9.81])
