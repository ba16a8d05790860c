"""What the sensors said."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(slots=True)
class Readings:
    """Sensor readings of one control tick, SI units; whoever senses fills one again and again.

    The IMU frame sits on the base and faces forward: x forward, y left, z up.

    Attributes:
        joint_position: (n,) encoders (rad).
        joint_velocity: (n,) encoders (rad/s).
        gravity: (3,) direction of gravity in the IMU frame, unit vector.
        gyro: (3,) angular velocity of the base in the IMU frame (rad/s).
        accelerometer: (3,) specific force of the base, its acceleration minus gravity, in the
            IMU frame: the mean since the reading before (m/s^2).
        foot_force: (2,) normal force under the left and right sole (N).
    """

    joint_position: Array
    joint_velocity: Array
    gravity: Array = field(default_factory=lambda: np.zeros(3))
    gyro: Array = field(default_factory=lambda: np.zeros(3))
    accelerometer: Array = field(default_factory=lambda: np.zeros(3))
    foot_force: Array = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def of(cls, n_joints: int) -> Readings:
        """Readings of ``n_joints`` joints, all zero."""
        return cls(np.zeros(n_joints), np.zeros(n_joints))
