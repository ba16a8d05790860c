"""The robot's sensors: encoders, base IMU and force/torque sensors under the feet."""

from __future__ import annotations

from collections import deque
from typing import Any

import mujoco
import numpy as np

from icub_jump_env.estimation.readings import Readings
from icub_jump_env.records import Array, Block
from icub_jump_env.robot.mujoco_model import sole_geom
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import World
from icub_jump_env.simulation.sensor_models import (
    ERROR_KINDS,
    SENSORS,
    ErrorSource,
    SensorConfig,
    SensorError,
)

_VIEWS = ("_imu_rotation", "_imu_gyro", "_base_velocity", "_sole_forces", "_soles")

_STREAMS = (
    "joint_position", "joint_velocity", "tilt", "gyro", "force", "moment", "force_gain",
    "accelerometer",
)  # fmt: skip
"""Each has a generator of its own, so that the errors of one kind do not depend on another's."""


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
        n = physics.robot.n_joints
        self._channels = {
            "joint_position": n,
            "joint_velocity": n,
            "tilt": 3,
            "gyro": 3,
            "accelerometer": 3,
            "force": 6,
            "moment": 6,
        }
        self.readings = Readings.of(n)
        self.encoder_bias, self.torque_error = np.zeros(n), np.zeros(n)
        self._world_bias = np.zeros(n)
        self._down = np.array([0.0, 0.0, -1.0])
        self._gravity = np.zeros(3)
        self._last_velocity, self._last_time = np.zeros(3), 0.0
        self._jacobian = np.zeros((6, physics.model.nv))
        self._errors: dict[str, ErrorSource] = {}
        self._force_gain = np.zeros(2)
        self._wrong_forces = False
        self._history: deque[Block] = deque(maxlen=1 + config.delay)

    def _bind(self) -> None:
        data = self._physics.data
        self._imu_rotation = data.site("imu").xmat.reshape(3, 3)
        self._imu_gyro = data.sensor("base_gyro").data
        # The IMU sits at the origin of the base.
        self._base_velocity = data.qvel[:3]
        self._sole_forces = [data.sensor(f"{side}_sole_force").data for side in "lr"]
        geoms = [self._physics.model.geom(sole_geom(side)) for side in "lr"]
        self._soles = [(data.geom_xpos[geom.id], int(geom.bodyid[0])) for geom in geoms]

    def __getstate__(self) -> dict[str, Any]:
        # Views of MuJoCo's arrays have to be taken anew from a copy's own data.
        return {name: value for name, value in self.__dict__.items() if name not in _VIEWS}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def reset(self, world: World, seed: int) -> None:
        """Draw the errors of an episode in ``world``; ``seed`` is that of all noise."""
        config = self._config.with_noise_of(SENSORS["realistic"], world.sensor_noise)
        self._errors = {
            kind: ErrorSource(
                getattr(config, kind),
                self._channels[kind],
                np.random.default_rng([seed, _STREAMS.index(kind)]),
            )
            for kind in ERROR_KINDS
            if getattr(config, kind) != SensorError()
        }
        rng = np.random.default_rng([seed, _STREAMS.index("force_gain")])
        self._force_gain = config.force_gain * rng.uniform(-1.0, 1.0, 2)
        self._wrong_forces = config.force_gain > 0.0 or not {"force", "moment"}.isdisjoint(
            self._errors
        )
        self.encoder_bias[:] = world.encoder_bias
        if "joint_position" in self._errors:
            self.encoder_bias += self._errors["joint_position"].bias
        self._world_bias[:] = world.encoder_bias
        gravity = self._gravity
        gravity[:] = self._physics.model.opt.gravity
        self._down[:] = gravity / np.linalg.norm(gravity)
        self._last_velocity[:], self._last_time = 0.0, 0.0
        self._history.clear()
        self.torque_error[:] = 0.0

    def drawn(self) -> dict[str, Any]:
        """The errors drawn at the reset: bias and drift by kind of reading, plain floats."""
        return {
            "force_gain": tuple(self._force_gain.tolist()),
            **{
                kind: {"bias": tuple(source.bias.tolist()), "drift": tuple(source.drift.tolist())}
                for kind, source in self._errors.items()
            },
        }

    def read(self) -> Readings:
        """Take new readings."""
        readings = self.readings
        readings.joint_position[:] = self._physics.joint_position
        readings.joint_position += self._world_bias
        readings.joint_velocity[:] = self._physics.joint_velocity
        np.dot(self._down, self._imu_rotation, out=readings.gravity)
        readings.gyro[:] = self._imu_gyro
        self._accelerate(readings)
        for foot, force in enumerate(self._sole_forces):
            readings.foot_force[foot] = force[3]
        if self._errors or self._wrong_forces:
            self._falsify(readings)
        if self._config.delay:
            self._postpone(readings)
        return readings

    def _accelerate(self, readings: Readings) -> None:
        time = self._physics.data.time
        passed, specific = time - self._last_time, -self._gravity
        if passed > 0.0:
            specific += (self._base_velocity - self._last_velocity) / passed
        np.dot(specific, self._imu_rotation, out=readings.accelerometer)
        self._last_velocity[:], self._last_time = self._base_velocity, time

    def _falsify(self, readings: Readings) -> None:
        time = self._physics.data.time
        error = {kind: source.at(time) for kind, source in self._errors.items()}
        readings.joint_position += error.get("joint_position", 0.0)
        readings.joint_velocity += error.get("joint_velocity", 0.0)
        readings.gyro += error.get("gyro", 0.0)
        readings.accelerometer += error.get("accelerometer", 0.0)
        if "tilt" in error:
            readings.gravity += _cross(error["tilt"], readings.gravity)
            readings.gravity /= np.linalg.norm(readings.gravity)
        if self._wrong_forces:
            forces = error.get("force", np.zeros(6)).reshape(2, 3)
            moments = error.get("moment", np.zeros(6)).reshape(2, 3)
            self._falsify_forces(readings, forces, moments)

    def _falsify_forces(
        self, readings: Readings, force_errors: Array, moment_errors: Array
    ) -> None:
        model, data = self._physics.model, self._physics.data
        self.torque_error[:] = 0.0
        for foot, (center, body) in enumerate(self._soles):
            force = force_errors[foot] + self._force_gain[foot] * self._sole_forces[foot][1:4]
            readings.foot_force[foot] += force[2]
            mujoco.mj_jac(model, data, self._jacobian[:3], self._jacobian[3:], center, body)
            wrench = np.concatenate((force, moment_errors[foot]))
            self.torque_error -= self._jacobian[:, 6:].T @ wrench

    def _postpone(self, readings: Readings) -> None:
        self._history.append(readings.block.copy())
        readings.block[:] = self._history[0]


def _cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors; NumPy's takes ten times as long."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])
