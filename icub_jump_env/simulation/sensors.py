"""The robot's sensors: encoders, base IMU and force/torque sensors under the feet."""

from __future__ import annotations

import math
from collections import deque
from typing import Annotated, Any

import mujoco
import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.estimation.readings import LOADED, Readings
from icub_jump_env.linear_algebra import add_cross, rotate_back
from icub_jump_env.records import Array, Block, Number, PerJoint, Record, Vector
from icub_jump_env.robot.mujoco_model import sole_geom
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import World
from icub_jump_env.simulation.sensor_models import (
    SENSORS,
    STREAMS,
    SensorConfig,
    SensorErrors,
)


class Sensing(Record):
    """What the sensors keep between readings.

    Attributes:
        encoder_bias: (n,) error of the world's encoders (rad).
        down: (3,) direction of gravity, world axes.
        gravity: (3,) m/s^2, world axes.
        velocity: (3,) of the base at the reading before, world axes (m/s).
        time: Of the reading before (s).
        force_gain: (2,) calibration error of the forces under the left and right foot.
    """

    encoder_bias: PerJoint
    down: Vector
    gravity: Vector
    velocity: Vector
    time: Number
    force_gain: Annotated[Array, (2,)]


class Sensors:
    """Takes :class:`Readings` of a physics, with their errors.

    Encoders show the present state; IMU and feet the beginning of the last physics step,
    when MuJoCo evaluated them. The accelerometer's mean ends with the present.

    Attributes:
        readings: The latest readings, which :meth:`read` overwrites.
        encoder_bias: (n,) constant part of the encoders' error (rad).
        torque_error: (n,) what the errors of the feet's force/torque sensors do to the
            joint torques computed from them (Nm): J^T times the wrench's error.
    """

    def __init__(self, physics: Physics, config: SensorConfig) -> None:
        """Set up the sensors of ``physics``; :meth:`reset` comes before the first reading."""
        self._physics = physics
        self._config = config
        self._bind()
        self._n_joints = n = physics.robot.n_joints
        self.readings = Readings.of(n)
        self.encoder_bias, self.torque_error = np.zeros(n), np.zeros(n)
        self._sensing = Sensing({"n": n}, down=(0.0, 0.0, -1.0))
        self._jacobians = np.zeros((2, 6, physics.model.nv))
        self._errors = SensorErrors(config, n, 0)
        self._wrong_forces = False
        self._history: deque[Block] = deque(maxlen=1 + config.delay)

    def _bind(self) -> None:
        physics, data = self._physics, self._physics.data
        # The IMU sits at the origin of the base.
        self._sources = (
            physics.joint_position, physics.joint_velocity, data.site("imu").xmat.reshape(3, 3),
            data.sensor("base_gyro").data, data.qvel[:3],
        )  # fmt: skip
        self._sole_forces = tuple(data.sensor(f"{side}_sole_force").data for side in "lr")
        geoms = [physics.model.geom(sole_geom(side)) for side in "lr"]
        self._soles = [(data.geom_xpos[geom.id], int(geom.bodyid[0])) for geom in geoms]
        self._sole_frames = tuple(
            array
            for geom in geoms
            for array in (data.geom_xpos[geom.id], data.geom_xmat[geom.id].reshape(3, 3))
        )

    def __getstate__(self) -> dict[str, Any]:
        # Views of MuJoCo's arrays have to be taken anew from a copy's own data.
        views = ("_sources", "_sole_forces", "_soles", "_sole_frames")
        return {name: value for name, value in self.__dict__.items() if name not in views}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def reset(self, world: World, seed: int) -> None:
        """Draw the errors of an episode in ``world``; ``seed`` is that of all noise."""
        config = self._config.with_noise_of(SENSORS["realistic"], world.sensor_noise)
        self._errors = errors = SensorErrors(config, self._n_joints, seed)
        rng = np.random.default_rng([seed, STREAMS["force_gain"]])
        gravity = self._physics.model.opt.gravity
        self._sensing = Sensing(
            {"n": self._n_joints},
            encoder_bias=world.encoder_bias,
            down=gravity / np.linalg.norm(gravity),
            gravity=gravity,
            force_gain=config.force_gain * rng.uniform(-1.0, 1.0, 2),
        )
        self._wrong_forces = config.force_gain > 0.0 or not {"force", "moment"}.isdisjoint(
            errors.kinds
        )
        self.encoder_bias[:] = world.encoder_bias + errors.bias.joint_position
        self._history.clear()
        self.torque_error[:] = 0.0

    def drawn(self) -> dict[str, Any]:
        """The errors drawn at the reset: bias and drift by kind of reading, plain floats."""
        bias, drift = self._errors.bias, self._errors.drift
        return {
            "force_gain": tuple(self._sensing.force_gain.tolist()),
            **{
                kind: {
                    "bias": tuple(getattr(bias, kind).ravel().tolist()),
                    "drift": tuple(getattr(drift, kind).ravel().tolist()),
                }
                for kind in self._errors.kinds
            },
        }

    def read(self) -> Readings:
        """Take new readings."""
        readings, time = self.readings.block, self._physics.data.time
        take(
            time, self._sensing.block, readings, *self._sources, *self._sole_forces,
            *self._sole_frames,
        )  # fmt: skip
        if self._errors.kinds or self._wrong_forces:
            errors = self._errors.draw(time).block
            falsify("tilt" in self._errors.kinds, errors, readings)
            if self._wrong_forces:
                self._find_jacobians()
                left, right = self._sole_forces
                falsify_forces(
                    self._sensing.block, self._jacobians, left, right, errors, readings,
                    self.torque_error,
                )  # fmt: skip
        if self._config.delay:
            self._postpone()
        return self.readings

    def _find_jacobians(self) -> None:
        model, data = self._physics.model, self._physics.data
        for (center, body), jacobian in zip(self._soles, self._jacobians, strict=True):
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], center, body)

    def _postpone(self) -> None:
        block = self.readings.block
        self._history.append(block.copy())
        block[:] = self._history[0]


@compiled
def take(
    time: float,
    sensing: Block,
    readings: Block,
    joint_position: Array,
    joint_velocity: Array,
    imu_rotation: Array,
    gyro: Array,
    base_velocity: Array,
    left_force: Array,
    right_force: Array,
    left_position: Array,
    left_rotation: Array,
    right_position: Array,
    right_rotation: Array,
) -> None:
    """Take readings without errors, but for the world's bias of the encoders.

    Args:
        time: Of the episode (s).
        sensing: Block of the :class:`Sensing`.
        readings: Block of the :class:`Readings`, which this fills.
        joint_position: (n,) rad.
        joint_velocity: (n,) rad/s.
        imu_rotation: (3, 3) orientation of the IMU.
        gyro: (3,) its angular velocity, IMU axes (rad/s).
        base_velocity: (3,) its velocity, world axes (m/s).
        left_force: (7,) of the left sole: contacts, the force forward, left and up (N), and where
            it acts (m), world axes.
        right_force: (7,) of the right sole.
        left_position: (3,) middle of the left sole (m).
        left_rotation: (3, 3) its orientation.
        right_position: (3,) of the right sole.
        right_rotation: (3, 3) likewise.
    """
    s, told = sensing[0], readings[0]
    for j in range(joint_position.shape[0]):
        told.joint_position[j] = joint_position[j] + s.encoder_bias[j]
        told.joint_velocity[j] = joint_velocity[j]
    told.foot_force[0], told.foot_force[1] = left_force[3], right_force[3]
    find_cop(left_force, left_position, left_rotation, told.cop[0])
    find_cop(right_force, right_position, right_rotation, told.cop[1])
    rotate_back(imu_rotation, s.down, told.gravity)
    passed, specific = time - s.time, -s.gravity
    for i in range(3):
        told.gyro[i] = gyro[i]
        if passed > 0.0:
            specific[i] += (base_velocity[i] - s.velocity[i]) / passed
        s.velocity[i] = base_velocity[i]
    rotate_back(imu_rotation, specific, told.accelerometer)
    s.time = time


@compiled
def find_cop(force: Array, position: Array, rotation: Array, cop: Array) -> None:
    """Write the centre of pressure of a sole, (2,), in its frame; zero if it carries nothing."""
    for axis in range(2):
        cop[axis] = 0.0
        if force[3] > LOADED:
            for i in range(3):
                cop[axis] += rotation[i, axis] * (force[4 + i] - position[i])


@compiled
def falsify(tilted: bool, errors: Block, readings: Block) -> None:
    """Add the errors of encoders and IMU.

    Args:
        tilted: Whether the direction of gravity has one.
        errors: Block of the :class:`icub_jump_env.simulation.sensor_models.Errors`.
        readings: Block of the :class:`Readings`.
    """
    e, told = errors[0], readings[0]
    for j in range(told.joint_position.shape[0]):
        told.joint_position[j] += e.joint_position[j]
        told.joint_velocity[j] += e.joint_velocity[j]
    for i in range(3):
        told.gyro[i] += e.gyro[i]
        told.accelerometer[i] += e.accelerometer[i]
    if tilted:
        add_cross(e.tilt, told.gravity.copy(), 1.0, told.gravity)
        x, y, z = told.gravity[0], told.gravity[1], told.gravity[2]
        told.gravity /= math.sqrt(x * x + y * y + z * z)


@compiled
def falsify_forces(
    sensing: Block,
    jacobians: Array,
    left_force: Array,
    right_force: Array,
    errors: Block,
    readings: Block,
    torque_error: Array,
) -> None:
    """Add the errors of the feet's force/torque sensors.

    Args:
        sensing: Block of the :class:`Sensing`.
        jacobians: (2, 6, n + 6) of the middles of the soles, linear part first, world axes.
        left_force: (7,) as of :func:`take`.
        right_force: (7,) likewise.
        errors: As of :func:`falsify`.
        readings: Likewise.
        torque_error: (n,) of the torques computed from the forces (Nm), which this sets.
    """
    e, gains = errors[0], sensing[0].force_gain
    torque_error[:] = 0.0
    for foot in range(2):
        measured = left_force if foot == 0 else right_force
        for i in range(3):
            force = e.force[foot, i] + gains[foot] * measured[1 + i]
            moment = e.moment[foot, i]
            if i == 2:
                readings[0].foot_force[foot] += force
            for j in range(torque_error.shape[0]):
                torque_error[j] -= jacobians[foot, i, 6 + j] * force
                torque_error[j] -= jacobians[foot, 3 + i, 6 + j] * moment
        moment, told = e.moment[foot], readings[0].foot_force[foot]
        falsify_cop(measured[3], told, moment[0], moment[1], readings[0].cop[foot])


@compiled
def falsify_cop(force: float, told: float, roll: float, pitch: float, cop: Array) -> None:
    """What errors of the moments (Nm) make of a centre of pressure, (2,): moments over force.

    Args:
        force: True force (N).
        told: What the sensor says (N).
        roll: Error of the moment about the forward axis.
        pitch: About the axis to the left.
        cop: From the middle of the sole (m), which this changes.
    """
    loaded = force > LOADED and told > LOADED
    cop[0] = (cop[0] * force - pitch) / told if loaded else 0.0
    cop[1] = (cop[1] * force + roll) / told if loaded else 0.0
