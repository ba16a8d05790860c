"""Drake's robot is MuJoCo's, where it is installed."""

import mujoco
import numpy as np
import pytest

from icub_jump_env.config import JumpConfig

pytest.importorskip("pydrake")

from experiments.second_engine import MODULUS, DrakeEnv, Twin
from icub_jump_env.simulation.physics import Physics


@pytest.fixture(scope="module")
def physics():
    return Physics(JumpConfig().robot_value, 1e-4)


@pytest.fixture
def moving(physics, rng):
    """A model in the air that moves at random, and its twin."""
    model, data = physics.model, physics.data
    model.opt.gravity[:] = rng.normal(size=3)
    data.qpos[:7] = (0.0, 0.0, 5.0, *rng.normal(size=4))
    data.qpos[7:] = physics.robot.crouch  # within the limits, where both are free
    data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
    data.qvel[:] = rng.normal(size=model.nv)
    data.ctrl[:] = rng.uniform(-5.0, 5.0, model.nu)
    twin = Twin(model, MODULUS)
    twin.set_state(data.qpos, data.qvel)
    mujoco.mj_forward(model, data)
    return model, data, twin


def test_the_state_comes_back(moving):
    _, data, twin = moving
    qpos, qvel = twin.state()
    np.testing.assert_allclose(qpos, data.qpos, atol=1e-12)
    np.testing.assert_allclose(qvel, data.qvel, atol=1e-12)


def test_the_mass_matrix_is_mujocos(moving):
    model, data, twin = moving
    ours = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, ours)
    theirs = twin.plant.CalcMassMatrix(twin.context)
    np.testing.assert_allclose(theirs[np.ix_(twin._rates, twin._rates)], ours[6:, 6:], atol=1e-12)


def test_a_step_in_the_air_is_mujocos(moving):
    """To second order in the step, as the integrators differ: gravity, torques, damping, a push."""
    model, data, twin = moving
    body, push = model.body("chest").id, np.array([3.0, -2.0, 1.0])
    data.xfrc_applied[body, :3] = push
    before = data.qvel.copy()
    twin.step(data.ctrl.copy(), body, push, model.body_ipos[body].copy())
    mujoco.mj_step(model, data)
    change = np.abs(data.qvel - before).max()
    np.testing.assert_allclose(twin.state()[1], data.qvel, atol=1e-2 * change)


def test_a_robot_sinks_deeper_into_a_softer_floor():
    heights = []
    for modulus in (MODULUS, MODULUS / 10.0):
        env = DrakeEnv(modulus)
        env.reset(seed=0)
        for _ in range(3):
            env.step(np.zeros(3))
        heights.append(env.data.qpos[2])
    assert heights[0] > heights[1] + 1e-5


def test_standing_the_soles_carry_the_weight():
    env = DrakeEnv()
    env.reset(seed=0)
    contacts = env._simulation.physics._twin.contacts()
    weight = 9.81 * env.model.body_mass.sum()
    assert sum(force[2] for force, _ in contacts.values()) == pytest.approx(weight, rel=0.02)
    centre = sum(force[2] * place for force, place in contacts.values()) / weight
    com = env.data.sensor("com").data
    np.testing.assert_allclose(centre[:2], com[:2], atol=0.005)
