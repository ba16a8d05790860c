"""What we believe of the robot."""

from __future__ import annotations

from typing import Annotated

from icub_jump_env.records import Array, PerJoint, Record, Rotation, Vector


class RobotState(Record):
    """Believed state at one control tick, SI units, world frame.

    An estimator fills one instance again and again.

    Attributes:
        joint_position: (n,) s (rad).
        joint_velocity: (n,) rad/s.
        base_rotation: (3, 3) orientation of the base.
        angular_velocity: (3,) of the base (rad/s).
        com: (3,) CoM position x (m).
        com_velocity: (3,) CoM velocity (m/s).
        angular_momentum: (3,) centroidal angular momentum H_omega (kg m^2/s).
        foot_force: (2,) normal force under the left and right sole (N).
        sole_position: (2, 3) middle of the underside of the left and right sole (m).
        gravity: (3,) direction of gravity, unit vector; where the floor is level, -z.
    """

    joint_position: PerJoint
    joint_velocity: PerJoint
    base_rotation: Rotation
    angular_velocity: Vector
    com: Vector
    com_velocity: Vector
    angular_momentum: Vector
    foot_force: Annotated[Array, (2,)]
    sole_position: Annotated[Array, (2, 3)]
    gravity: Vector
