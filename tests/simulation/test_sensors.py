"""Sensor errors: what was asked for is what is measured."""

import math
import pickle

import mujoco
import numpy as np
import pytest

from icub_jump_env.errors import ConfigError
from icub_jump_env.estimation.readings import LOADED
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import Randomization, draw_world
from icub_jump_env.simulation.sensor_models import (
    AHEAD,
    ERROR_KINDS,
    SENSORS,
    STREAMS,
    SensorConfig,
    SensorError,
)
from icub_jump_env.simulation.sensors import Sensors, falsify_cop, find_cop

ROBOT = load_robot()

NOMINAL = draw_world(Randomization(), ROBOT, 1, np.random.default_rng(0))


@pytest.fixture(scope="module")
def physics():
    physics = Physics(ROBOT, 0.001)
    physics.reset(np.concatenate(([0, 0, 0.6, 0, 0, 0, 1], ROBOT.crouch)))
    physics.step()
    return physics


def sensors(physics, seed=0, world=NOMINAL, **config) -> Sensors:
    made = Sensors(physics, SensorConfig(**config))
    made.reset(world, seed)
    return made


def readings(made):
    taken = made.read()
    return {name: taken.block[name][0].copy() for name in taken.block.dtype.names}


READING = {"joint_position": "joint_position", "joint_velocity": "joint_velocity",
           "tilt": "gravity", "gyro": "gyro", "force": "foot_force", "moment": None,
           "accelerometer": "accelerometer"}  # fmt: skip


@pytest.mark.parametrize("kind", ERROR_KINDS)
def test_an_error_shows_in_its_reading_alone(physics, kind):
    truth = readings(sensors(physics))
    wrong = readings(sensors(physics, **{kind: SensorError(noise=0.1)}))
    for name, reading in truth.items():
        assert np.array_equal(reading, wrong[name]) == (name != READING[kind])


def test_noise_has_the_standard_deviation_asked_for(physics):
    made = sensors(physics, joint_velocity=SensorError(noise=0.3))
    samples = np.array([readings(made)["joint_velocity"] for _ in range(500)])
    errors = samples - physics.joint_velocity
    assert errors.std() == pytest.approx(0.3, rel=0.03)
    assert abs(errors.mean()) < 0.02
    white = np.corrcoef(errors[:-1].ravel(), errors[1:].ravel())[0, 1]
    assert abs(white) < 0.03


def test_noise_is_as_if_drawn_one_by_one(physics):
    made = sensors(physics, seed=5, gyro=SensorError(noise=0.3))
    rng = np.random.default_rng([5, STREAMS["gyro"]])
    rng.uniform(size=(2, 3))  # bias and drift
    truth = physics.data.sensor("base_gyro").data
    for _ in range(AHEAD + 3):
        expected = truth + 0.3 * rng.standard_normal(3)
        np.testing.assert_array_equal(readings(made)["gyro"], expected)


def test_bias_is_constant_within_an_episode_and_uniform_over_episodes(physics):
    made = sensors(physics, gyro=SensorError(bias=0.2))
    drawn = []
    for seed in range(300):
        made.reset(NOMINAL, seed)
        first, second = readings(made)["gyro"], readings(made)["gyro"]
        np.testing.assert_array_equal(first, second)
        drawn.append(first - physics.data.sensor("base_gyro").data)
    drawn = np.array(drawn)
    assert np.abs(drawn).max() <= 0.2
    assert drawn.std() == pytest.approx(0.2 / math.sqrt(3), rel=0.1)


def test_drift_grows_linearly(physics):
    made = sensors(physics, force=SensorError(drift=4.0))
    offsets, start = [], physics.data.time
    for time in (0.0, 1.0, 2.0):
        physics.data.time = time
        offsets.append(readings(made)["foot_force"])
    physics.data.time = start
    np.testing.assert_allclose(offsets[0], 0.0)
    vertical = np.array(made.drawn()["force"]["drift"]).reshape(2, 3)[:, 2]
    assert np.abs(vertical).min() > 0.1
    np.testing.assert_allclose(offsets[1], vertical)
    np.testing.assert_allclose(offsets[2], 2 * vertical)
    rates = []
    for seed in range(200):
        made.reset(NOMINAL, seed)
        rates.append(made.drawn()["force"]["drift"])
    assert np.abs(rates).max() <= 4.0
    assert np.std(rates) == pytest.approx(4.0 / math.sqrt(3), rel=0.1)
    assert abs(np.mean(rates)) < 0.5


@pytest.mark.parametrize("delay", [1, 3])
def test_delay_shows_the_past(delay):
    physics = Physics(ROBOT, 0.001)
    physics.reset(np.concatenate(([0, 0, 0.6, 0, 0, 0, 1], ROBOT.crouch)))
    delayed, present = sensors(physics, delay=delay), sensors(physics)
    now = []
    for tick in range(10):
        physics.step()
        now.append(readings(present))
        late = readings(delayed)
        for name, reading in late.items():
            np.testing.assert_array_equal(reading, now[max(0, tick - delay)][name])
    assert not np.array_equal(now[0]["joint_velocity"], now[3]["joint_velocity"])


def test_gravity_stays_a_unit_vector_tilted_by_the_error(physics):
    truth = readings(sensors(physics))["gravity"]
    made = sensors(physics, tilt=SensorError(bias=0.02))
    wrong = readings(made)["gravity"]
    assert np.linalg.norm(wrong) == pytest.approx(1.0)
    assert 0.001 < np.arccos(truth @ wrong) < 0.02 * math.sqrt(3)


class TestAccelerometer:
    def test_a_falling_robot_feels_nothing_and_a_resting_one_its_weight(self):
        physics = Physics(ROBOT, 0.001)
        physics.reset(np.concatenate(([0, 0, 2.0, 0.9, 0.1, 0.3, 0.3], ROBOT.crouch)))
        made = sensors(physics)
        resting = readings(made)
        np.testing.assert_allclose(resting["accelerometer"], -9.81 * resting["gravity"])
        for _ in range(5):
            physics.step()
        np.testing.assert_allclose(readings(made)["accelerometer"], 0.0, atol=1e-9)

    def test_it_is_the_mean_since_the_reading_before(self):
        """Turned into the world and summed up it gives the velocity gained."""
        physics = Physics(ROBOT, 0.001)
        physics.reset(np.concatenate(([0, 0, 2.0, 0.9, 0.1, 0.3, 0.3], ROBOT.crouch)))
        made = sensors(physics)
        readings(made)
        gained, last = np.zeros(3), physics.data.time
        for n_steps in (5, 2, 3):
            for _ in range(n_steps):
                physics.control[:] = 5.0
                physics.step()
            felt = physics.data.site("imu").xmat.reshape(3, 3) @ readings(made)["accelerometer"]
            gained += (felt + [0.0, 0.0, -9.81]) * (physics.data.time - last)
            last = physics.data.time
        np.testing.assert_allclose(gained, physics.data.qvel[:3], atol=1e-12)
        assert np.linalg.norm(gained) > 0.05


def test_wrench_errors_reach_the_torques_through_the_transposed_jacobian(physics):
    """The power of the wrench error equals that of the torque error, joint by joint."""
    made = sensors(physics, force=SensorError(bias=10.0), moment=SensorError(bias=1.0))
    made.read()
    force, moment = (
        np.array(made.drawn()[kind]["bias"]).reshape(2, 3) for kind in ("force", "moment")
    )
    expected = np.zeros(ROBOT.n_joints)
    moved, eps = Physics(ROBOT, 0.001), 1e-6
    for joint in range(ROBOT.n_joints):
        velocity, omega = sole_motion(moved, physics.data.qpos, joint, eps)
        expected[joint] = -np.sum(force * velocity) - np.sum(moment * omega)
    np.testing.assert_allclose(made.torque_error, expected, atol=1e-4)
    assert np.abs(made.torque_error).max() > 1.0


def sole_motion(physics, qpos, joint, eps):
    """Velocities (2, 3) and angular velocities (2, 3) of the soles per joint velocity."""
    positions, rotations = [], []
    for step in (-eps, eps):
        target = qpos.copy()
        target[7 + joint] += step
        physics.reset(target)
        soles = [physics.data.geom(f"{side}_sole_contact") for side in "lr"]
        positions.append(np.array([sole.xpos for sole in soles]))
        rotations.append(np.array([sole.xmat.reshape(3, 3) for sole in soles]))
    spin = (rotations[1] - rotations[0]) / (2 * eps) @ rotations[0].transpose(0, 2, 1)
    omega = np.stack((spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]), axis=1)
    return (positions[1] - positions[0]) / (2 * eps), omega


def test_force_gain_scales_the_force():
    physics = Physics(ROBOT, 0.001)
    physics.reset(np.concatenate(([0, 0, 0.47, 0, 0, 0, 1], ROBOT.crouch)))
    for _ in range(200):
        physics.step()
        if physics.data.sensor("floor_force").data[3] > 50:
            break
    truth = readings(sensors(physics))["foot_force"]
    made = sensors(physics, force_gain=0.1)
    gains = np.array(made.drawn()["force_gain"])
    wrong = readings(made)["foot_force"]
    np.testing.assert_allclose(wrong, truth * (1 + gains))
    assert abs(truth[0] - truth[1]) > 0.1  # else left and right could be swapped
    # All three components of the force count, here through the ankle's lever.
    forces = np.array([force[1:4] for force in made._sole_forces])
    jacobians = []
    for side in "lr":
        geom = physics.model.geom(f"{side}_sole_contact")
        jacobian = np.zeros((3, physics.model.nv))
        center = physics.data.geom_xpos[geom.id]
        mujoco.mj_jac(physics.model, physics.data, jacobian, None, center, geom.bodyid[0])
        jacobians.append(jacobian[:, 6:])
    assert np.abs(forces[:, :2]).max() > 1.0
    expected = -sum(
        gain * jacobian.T @ force
        for gain, jacobian, force in zip(gains, jacobians, forces, strict=True)
    )
    np.testing.assert_allclose(made.torque_error, expected, atol=1e-9)
    assert (np.abs(gains) <= 0.1).all()


def test_same_seed_same_errors_and_another_seed_others(physics):
    made = Sensors(physics, SENSORS["realistic"])
    series = []
    for seed in (3, 4, 3):
        made.reset(NOMINAL, seed)
        series.append([readings(made) for _ in range(4)])
    for a, b, c in zip(*series, strict=True):
        for name in a:
            np.testing.assert_array_equal(a[name], c[name])
        assert not np.array_equal(a["joint_velocity"], b["joint_velocity"])


def test_a_pickled_copy_continues_with_the_same_errors(physics):
    made = Sensors(physics, SENSORS["realistic"])
    made.reset(NOMINAL, 5)
    readings(made)
    copy = pickle.loads(pickle.dumps(made))
    for _ in range(3):
        ours, theirs = readings(made), readings(copy)
        for name in ours:
            np.testing.assert_array_equal(ours[name], theirs[name])


def test_noise_on_top_adds_variances():
    base = SensorConfig(gyro=SensorError(noise=3.0, bias=1.0))
    both = base.with_noise_of(SensorConfig(gyro=SensorError(noise=8.0, drift=9.0)), 0.5)
    assert both.gyro == SensorError(noise=5.0, bias=1.0)
    assert base.with_noise_of(SENSORS["realistic"], 0.0) == base


@pytest.mark.parametrize(
    "values", [{"tilt": 0.1}, {"force_gain": -0.1}, {"delay": 1.5}, {"delay": -1}]
)
def test_bad_configurations_are_refused(values):
    with pytest.raises(ConfigError) as refusal:
        SensorConfig(**values)
    assert refusal.value.field in values
    with pytest.raises(ConfigError, match="noise"):
        SensorError(noise=-1.0)


@pytest.mark.parametrize("force", [LOADED - 0.1, LOADED + 0.1, 90.0])
def test_a_loaded_sole_has_a_centre_of_pressure(force):
    """Where the force acts, in the sole's axes, as moments say that are a little wrong."""
    assert LOADED == 5.0  # N, of which the pages speak
    rotation = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    position, forward, left = np.array([1.0, 2.0, 0.0]), 0.03, -0.02
    where = position + rotation @ (forward, left, 0.0)
    cop = np.full(2, np.nan)
    find_cop(np.array([1.0, 0.0, 0.0, force, *where]), position, rotation, cop)
    loaded = force > LOADED
    np.testing.assert_allclose(cop, np.array([forward, left]) * loaded, atol=1e-15)
    roll, pitch, told = 0.4, -0.3, 1.1 * force
    falsify_cop(force, told, roll, pitch, cop)
    moved = np.array([forward * force - pitch, left * force + roll]) / told
    np.testing.assert_allclose(cop, moved * loaded)


@pytest.mark.parametrize(("force", "told"), [(LOADED + 1.0, LOADED), (LOADED, LOADED + 1.0)])
def test_a_sole_that_hardly_seems_loaded_has_none(force, told):
    cop = np.array([0.03, -0.02])
    falsify_cop(force, told, 0.4, -0.3, cop)
    assert cop.tolist() == [0.0, 0.0]
