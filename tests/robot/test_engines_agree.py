"""MuJoCo against Pinocchio on random states: two independent implementations."""

import functools

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from icub_jump_env.robot import icub
from icub_jump_env.robot.frames import mujoco_qpos, mujoco_qvel, pinocchio_q, pinocchio_v
from icub_jump_env.robot.kinematics import build_pinocchio_model
from icub_jump_env.robot.mujoco_model import build_model
from icub_jump_env.robot.robot import load_robot

RELATIVE = 1e-9


def close(actual, expected):
    scale = max(1e-3, float(np.abs(expected).max()))
    assert np.abs(actual - expected).max() <= RELATIVE * scale


ROBOTS = "iCubGenova04", "iCubGenova02", "iCubGenova01"
compiled = functools.cache(build_model)


class Both:
    """One random state in both engines."""

    def __init__(self, name, seed):
        rng, robot = np.random.default_rng(seed), load_robot(name)
        self.pin_model = build_pinocchio_model(robot)
        self.pin_data = self.pin_model.createData()
        quaternion = rng.normal(size=4)
        lower, upper = self.pin_model.lowerPositionLimit[7:], self.pin_model.upperPositionLimit[7:]
        self.q = np.concatenate(
            (
                rng.normal(size=3),
                quaternion / np.linalg.norm(quaternion),
                rng.uniform(lower, upper),
            )
        )
        self.v = rng.normal(size=self.pin_model.nv)
        self.model = compiled(robot, 0.001)
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = mujoco_qpos(self.q)
        self.data.qvel[:] = mujoco_qvel(self.q, self.v)
        mujoco.mj_forward(self.model, self.data)
        # v_mujoco = X v_pinocchio: only the linear base velocity changes its frame.
        self.X = np.eye(self.pin_model.nv)
        self.X[:3, :3] = pin.Quaternion(self.q[3:7]).matrix()


@pytest.fixture(params=[(name, seed) for name in ROBOTS for seed in range(10)], ids=str)
def both(request):
    return Both(*request.param)


def test_mass_matrix(both):
    M = np.zeros((both.model.nv, both.model.nv))
    mujoco.mj_fullM(both.model, both.data, M)
    expected = pin.crba(both.pin_model, both.pin_data, both.q)
    expected = np.triu(expected) + np.triu(expected, 1).T
    close(both.X.T @ M @ both.X, expected)


def test_bias_forces(both):
    M = np.zeros((both.model.nv, both.model.nv))
    mujoco.mj_fullM(both.model, both.data, M)
    # The derivative of X v: the base frame turns under the linear velocity.
    X_dot_v = np.zeros(both.model.nv)
    X_dot_v[:3] = both.X[:3, :3] @ np.cross(both.v[3:6], both.v[:3])
    expected = pin.nonLinearEffects(both.pin_model, both.pin_data, both.q, both.v)
    close(both.X.T @ (both.data.qfrc_bias + M @ X_dot_v), expected)


def test_com(both):
    close(both.data.subtree_com[1], pin.centerOfMass(both.pin_model, both.pin_data, both.q))


def test_com_jacobian(both):
    J = np.zeros((3, both.model.nv))
    mujoco.mj_jacSubtreeCom(both.model, both.data, J, 1)
    close(J @ both.X, pin.jacobianCenterOfMass(both.pin_model, both.pin_data, both.q))


@pytest.mark.parametrize("link", [*icub.SOLE_FRAMES, icub.CHEST_LINK, "head", "l_hand"])
def test_link_jacobian(both, link):
    J = np.zeros((6, both.model.nv))
    mujoco.mj_jacBody(both.model, both.data, J[:3], J[3:], both.model.body(link).id)
    frame = both.pin_model.getFrameId(link)
    expected = pin.computeFrameJacobian(
        both.pin_model, both.pin_data, both.q, frame, pin.LOCAL_WORLD_ALIGNED
    )
    close(J @ both.X, expected)


def test_centroidal_momentum(both):
    expected = pin.computeCentroidalMomentum(both.pin_model, both.pin_data, both.q, both.v)
    mass = both.model.body_mass.sum()
    close(both.data.sensor("com_velocity").data * mass, expected.linear)
    close(both.data.sensor("angular_momentum").data, expected.angular)


def test_conversions_invert_each_other(both):
    np.testing.assert_array_equal(pinocchio_q(mujoco_qpos(both.q)), both.q)
    close(pinocchio_v(both.q, mujoco_qvel(both.q, both.v)), both.v)
