"""Equations of motion on fixed feet against Pinocchio's inverse dynamics."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from standing import GRAVITY, MODEL, ROBOT, N, Oracle, Standing

from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import build_pinocchio_model

seeds = st.integers(0, 10_000)


class Random:
    """A random state and (s_ddot, f), in our form and in Pinocchio's floating-base model."""

    def __init__(self, seed):
        standing = Standing(seed)
        rng = standing.rng
        s, s_dot = ROBOT.crouch + 0.1 * rng.normal(size=N), rng.normal(size=N)
        standing.be(s, s_dot)
        self.kinematics, self.oracle = standing.kinematics, Oracle(standing)
        self.dynamics = FeetFixedDynamics(self.kinematics)
        self.dynamics.update(s, s_dot)
        self.x = np.concatenate((rng.normal(size=N), 20 * rng.normal(size=12)))
        self.s_ddot, self.f = self.x[:N], self.x[N:]
        self.nu_dot = self.oracle.acceleration(self.s_ddot)


@given(seeds)
def test_rows_equal_inverse_dynamics(seed):
    state = Random(seed)
    forces, ours = state.oracle.forces(state.s_ddot, state.f), state.dynamics
    np.testing.assert_allclose(ours.base_rows @ state.x - ours.base_bias, forces[:6], atol=1e-9)
    np.testing.assert_allclose(
        ours.torque_rows @ state.x + ours.torque_bias, forces[6:], atol=1e-9
    )


@given(seeds)
def test_foot_bias_is_the_drift_of_the_right_foot(seed):
    state = Random(seed)
    right = state.oracle.J[1] @ state.nu_dot + state.oracle.drift[1]
    relative = state.kinematics.J_feet @ state.s_ddot - state.dynamics.foot_bias
    np.testing.assert_allclose(state.oracle.in_base_frame(right), -relative, atol=1e-9)


@given(seeds)
def test_force_and_moment_rows_sum_the_contacts(seed):
    state = Random(seed)
    total, R = state.oracle.contact(state.f), state.kinematics.base_rotation
    np.testing.assert_allclose(R @ (state.dynamics.force_rows @ state.f), total[:3], atol=1e-9)
    np.testing.assert_allclose(R @ (state.dynamics.moment_rows @ state.f), total[3:], atol=1e-9)


def test_momentum_balance():
    """Newton and Euler: with the feet at rest, the contact forces change the momentum."""
    state = Random(3)
    ours, oracle = state.dynamics, state.oracle
    # Wrenches that satisfy the base rows for the given joint accelerations.
    rows, bias = ours.base_rows, ours.base_bias
    f, *_ = np.linalg.lstsq(rows[:, N:], bias - rows[:, :N] @ state.s_ddot, rcond=None)
    data = MODEL.createData()
    pin.computeCentroidalMomentumTimeVariation(MODEL, data, oracle.q, oracle.nu, state.nu_dot)
    R, weight = state.kinematics.base_rotation, state.kinematics.mass * GRAVITY
    np.testing.assert_allclose(R @ (ours.force_rows @ f) + weight, data.dhg.linear, atol=1e-8)
    np.testing.assert_allclose(R @ (ours.moment_rows @ f), data.dhg.angular, atol=1e-8)


def test_shared_model_keeps_its_gravity():
    Random(0)
    assert build_pinocchio_model(ROBOT).gravity.linear == pytest.approx([0, 0, -9.81])
