"""What the sensors said."""

from __future__ import annotations

from typing import Annotated

from icub_jump_env.records import Array, PerJoint, Record, Vector

LOADED = 5.0
"""Force under a sole (N) from which on it is in contact, and has a centre of pressure."""


class Readings(Record):
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
        cop: (2, 2) centre of pressure from the middle of each sole, forward and left (m); zero
            of a sole in the air.
    """

    joint_position: PerJoint
    joint_velocity: PerJoint
    gravity: Vector
    gyro: Vector
    accelerometer: Vector
    foot_force: Annotated[Array, (2,)]
    cop: Annotated[Array, (2, 2)]

    @classmethod
    def of(cls, n_joints: int) -> Readings:
        """Readings of ``n_joints`` joints, all zero."""
        return cls({"n": n_joints})
