"""Limits of the joints as compiled functions take them."""

from __future__ import annotations

from icub_jump_env.records import PerJoint, Record
from icub_jump_env.robot.robot import Robot


class JointLimits(Record):
    """Limits of n joints.

    Attributes:
        lower, upper: (n,) positions (rad).
        speed: (n,) rad/s.
        torque: (n,) Nm.
    """

    lower: PerJoint
    upper: PerJoint
    speed: PerJoint
    torque: PerJoint

    @classmethod
    def of(cls, robot: Robot) -> JointLimits:
        """Those of a robot."""
        return cls(
            {"n": robot.n_joints},
            lower=robot.lower_position,
            upper=robot.upper_position,
            speed=robot.velocity_limit,
            torque=robot.effort_limit,
        )
