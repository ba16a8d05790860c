"""The robot's sensors, ideal: encoders, base IMU and foot force sensors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot import facts
from icub_jump_env.simulation.physics import Physics

Array = NDArray[np.float64]


class Sensors:
    """Latest readings, refreshed by :meth:`read`.

    Encoders show the present state; IMU and feet the beginning of the last physics step,
    when MuJoCo evaluated them.

    The IMU frame sits on ``root_link`` and faces forward: x forward, y left, z up.

    Attributes:
        joint_position: (23,) encoders (rad).
        joint_velocity: (23,) encoders (rad/s).
        gravity: (3,) direction of gravity in the IMU frame, unit vector.
        gyro: (3,) angular velocity of the base in the IMU frame (rad/s).
        foot_force: (2,) normal force under the left and right sole (N).
    """

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        data = physics.data
        self._imu_rotation = data.site("imu").xmat
        self._imu_gyro = data.sensor("base_gyro").data
        self._sole_forces = [data.sensor(f"{side}_sole_force").data for side in "lr"]
        self.joint_position = np.zeros(facts.N_JOINTS)
        self.joint_velocity = np.zeros(facts.N_JOINTS)
        self.gravity = np.zeros(3)
        self.gyro = np.zeros(3)
        self.foot_force = np.zeros(2)

    def __reduce__(self) -> tuple[type[Sensors], tuple[Physics]]:
        return Sensors, (self._physics,)

    def read(self) -> None:
        """Take new readings."""
        self.joint_position[:] = self._physics.joint_position
        self.joint_velocity[:] = self._physics.joint_velocity
        np.negative(self._imu_rotation[6:], out=self.gravity)
        self.gyro[:] = self._imu_gyro
        for foot, force in enumerate(self._sole_forces):
            self.foot_force[foot] = force[3]
