"""What the metrics need to know of the true state: no simulator in sight."""

from __future__ import annotations

import math
from typing import Annotated, Any

from icub_jump_env.records import Array, Number, PerJoint, Record, Vector


class TrueState(Record):
    """The true state at one instant, in SI units and the world frame.

    World frame: +x where the robot faces, +y left, +z up. Whoever simulates fills one
    instance again and again.

    Attributes:
        time: Time since the start of the episode (s).
        com: (3,) CoM position.
        com_velocity: (3,) CoM velocity.
        angular_momentum: (3,) angular momentum about the CoM, H_omega.
        locked_inertia: (3, 3) inertia of the equivalent rigid body about the CoM.
        ground_force: Vertical force of the ground on the robot (N).
        sole_height: Height of the lowest corner of the lower sole (m).
        only_feet_touch: Whether nothing but the soles touches the ground: 0 or 1.
        base_pitch: Pitch of the base about +y, zero when upright (rad).
        sole_position: (2, 3) centres of the left and the right sole.
        chest_up: (3,) the chest's up axis.
        joint_position: (n,) rad.
        joint_velocity: (n,) rad/s.
        joint_torque: (n,) Nm.
    """

    time: Number
    com: Vector
    com_velocity: Vector
    angular_momentum: Vector
    locked_inertia: Annotated[Array, (3, 3)]
    ground_force: Number
    sole_height: Number
    only_feet_touch: Number
    base_pitch: Number
    sole_position: Annotated[Array, (2, 3)]
    chest_up: Vector
    joint_position: PerJoint
    joint_velocity: PerJoint
    joint_torque: PerJoint

    def __init__(self, n_joints: int, **values: Any) -> None:
        """An upright robot of ``n_joints`` joints, but for the ``values`` of some fields."""
        upright = {
            "locked_inertia": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
            "only_feet_touch": True,
            "chest_up": (0.0, 0.0, 1.0),
        }
        super().__init__({"n": n_joints}, **(upright | values))

    @property
    def chest_tilt(self) -> float:
        """Angle between the chest's up axis and +z (rad)."""
        return math.acos(min(1.0, max(-1.0, float(self.chest_up[2]))))
