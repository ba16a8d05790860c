"""The simulated world: contact, ground truth, sensors, divergence."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from icub_jump_env.robot.frames import pinocchio_q, pinocchio_v
from icub_jump_env.robot.kinematics import build_pinocchio_model
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.ground_truth import GroundTruth
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.sensor_models import SensorConfig
from icub_jump_env.simulation.sensors import Sensors

ROBOT = load_robot()

zeros = np.zeros(ROBOT.n_joints)


def thrown(physics, seed=0, height=1.5):
    """Put the robot into the air, turning and moving its joints."""
    rng = np.random.default_rng(seed)
    qpos = np.concatenate(([0, 0, height], rng.normal(size=4), ROBOT.crouch))
    qpos[3:7] /= np.linalg.norm(qpos[3:7])
    physics.reset(qpos)
    physics.data.qvel[:] = 0.5 * rng.normal(size=physics.model.nv)


@pytest.fixture
def physics():
    return Physics(ROBOT, 0.001)


@pytest.mark.parametrize("seed", range(5))
def test_ground_truth_against_pinocchio(physics, seed):
    thrown(physics, seed)
    truth = GroundTruth(physics)
    qpos, qvel = physics.data.qpos.copy(), physics.data.qvel.copy()
    physics.step()
    state = truth.read()

    model = build_pinocchio_model(ROBOT)
    data = model.createData()
    q = pinocchio_q(qpos)
    v = pinocchio_v(q, qvel)
    pin.ccrba(model, data, q, v)
    assert state.time == 0.0
    np.testing.assert_allclose(state.com, data.com[0], atol=1e-10)
    np.testing.assert_allclose(state.com_velocity, data.hg.linear / 33.0616727, atol=1e-8)
    np.testing.assert_allclose(state.angular_momentum, data.hg.angular, atol=1e-9)
    np.testing.assert_allclose(state.locked_inertia, data.Ig.inertia, atol=1e-9)
    pin.framesForwardKinematics(model, data, q)
    corners = [
        data.oMf[model.getFrameId(frame)].act(np.array([x, y, ROBOT.sole.bottom]))[2]
        for frame in ROBOT.sole_frames
        for x in (ROBOT.sole.x_min, ROBOT.sole.x_max)
        for y in (-ROBOT.sole.half_width, ROBOT.sole.half_width)
    ]
    # The box is 8 mm thick; upside down its top corners are the lowest.
    assert min(corners) - 0.0081 <= state.sole_height <= min(corners) + 1e-9
    middle = np.array([ROBOT.sole.center_x, 0.0, ROBOT.sole.bottom + 0.004])
    for foot, frame in enumerate(ROBOT.sole_frames):
        center = data.oMf[model.getFrameId(frame)].act(middle)
        np.testing.assert_allclose(state.sole_position[foot], center, atol=1e-9)
    up = data.oMf[model.getFrameId("chest")].rotation @ [0, 1, 0]
    np.testing.assert_allclose(state.chest_up, up, atol=1e-9)
    assert state.chest_tilt == pytest.approx(np.arccos(up[2]))


def test_chest_is_upright_in_the_straight_posture(physics):
    physics.reset(np.concatenate(([0, 0, 1.0, 0, 0, 0, 1], zeros)))
    physics.step()
    state = GroundTruth(physics).read()
    assert state.chest_tilt == pytest.approx(0.0, abs=1e-3)
    assert state.base_pitch == pytest.approx(0.0, abs=1e-3)


def test_positive_base_pitch_leans_forward(physics):
    """Turn the upright robot by +0.2 rad about world +y: its head moves to +x."""
    yaw = np.array([0, 0, 0, 1.0])
    pitch = np.array([np.cos(0.1), 0, np.sin(0.1), 0])
    quaternion = np.zeros(4)
    mujoco.mju_mulQuat(quaternion, pitch, yaw)
    physics.reset(np.concatenate(([0, 0, 1.0], quaternion, zeros)))
    physics.step()
    assert GroundTruth(physics).read().base_pitch == pytest.approx(0.2, abs=1e-3)
    head, base = (physics.data.body(name).xpos[0] for name in ("head", ROBOT.base_link))
    assert head > base
    sensors = Sensors(physics, SensorConfig())
    gravity = sensors.read().gravity
    # Leaning forward, gravity points towards the front of the base.
    np.testing.assert_allclose(gravity, [np.sin(0.2), 0, -np.cos(0.2)], atol=1e-3)


def test_gyro_is_in_the_forward_facing_frame(physics):
    physics.reset(np.concatenate(([0, 0, 1.0, 0, 0, 0, 1], zeros)))
    # MuJoCo's angular velocity is in the frame of root_link, which faces backwards.
    physics.data.qvel[3:6] = [0.1, 0.2, 0.3]
    mujoco.mj_forward(physics.model, physics.data)
    sensors = Sensors(physics, SensorConfig())
    np.testing.assert_allclose(sensors.read().gyro, [-0.1, -0.2, 0.3], atol=1e-9)


def test_momentum_is_conserved_in_the_air(physics):
    """Whatever the joints do, gravity alone changes the momentum."""
    thrown(physics)
    truth = GroundTruth(physics)
    rng = np.random.default_rng(1)
    physics.step()
    start = truth.read()
    momentum, velocity, time = start.angular_momentum.copy(), start.com_velocity.copy(), start.time
    for _ in range(200):
        physics.control[:] = 0.3 * ROBOT.effort_limit * rng.normal(size=ROBOT.n_joints)
        physics.step()
    state = truth.read()
    assert state.ground_force == 0.0
    np.testing.assert_allclose(state.angular_momentum, momentum, atol=0.02)
    fall = [0, 0, -9.81 * (state.time - time)]
    np.testing.assert_allclose(state.com_velocity, velocity + fall, atol=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_fallen_robot_stays_on_the_floor(physics, seed):
    thrown(physics, seed, height=0.8)
    truth = GroundTruth(physics)
    touched = False
    for _ in range(3000):
        physics.control[:] = -2.0 * physics.joint_velocity
        physics.step()
        touched |= not truth.read().only_feet_touch
    assert touched
    assert not physics.diverged
    assert truth.state.com[2] > 0.05
    assert truth.state.ground_force == pytest.approx(324.3, rel=0.05)


def test_soles_collide_with_the_floor_and_no_link_with_another(physics):
    pairs = set()
    thrown(physics, 3, height=0.6)
    floor = physics.model.geom("floor").id
    for _ in range(1000):
        physics.step()
        pairs |= {tuple(pair) for pair in physics.data.contact.geom}
    assert pairs
    assert all(floor in pair for pair in pairs)


@pytest.mark.parametrize("poison", [np.nan, np.inf, 1e12])
@pytest.mark.parametrize("field", ["qpos", "qvel"])
def test_divergence_is_noticed_though_mujoco_resets_itself(physics, field, poison):
    thrown(physics)
    assert not physics.diverged
    getattr(physics.data, field)[10] = poison
    assert physics.diverged
    physics.step()
    assert np.isfinite(physics.data.qpos).all()
    assert physics.diverged


def test_reset_clears_divergence(physics):
    physics.data.qvel[3] = np.nan
    physics.step()
    thrown(physics)
    physics.step()
    assert not physics.diverged
