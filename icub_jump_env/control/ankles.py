"""Ankles that carry the feet's centres of pressure (CoP), by torque."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block, Number, Record
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot


def ankle_joints(robot: Robot) -> NDArray[np.int64]:
    """(2, 2) indices of the joints that pitch and roll the left and the right foot."""
    axes = ("pitch", "roll")
    names = [[f"{side}_ankle_{axis}" for axis in axes] for side in "lr"]
    return np.array([[robot.joint_names.index(name) for name in of_foot] for of_foot in names])


class Ankles(Record):
    """What :func:`carry` knows of the robot: geometry of feet flat on the floor.

    Attributes:
        height: Of the ankles above the floor (m).
        to_middle: From an ankle forward to the middle of its sole (m).
        turns: (2, 2) whether the pitch and roll joints of the left and the right foot turn them
            about the robot's left and front (1) or the opposite (-1).
    """

    height: Number
    to_middle: Number
    turns: Annotated[Array, (2, 2)]

    @classmethod
    def of(cls, robot: Robot) -> Ankles:
        """Those of a robot."""
        kinematics = FeetFixedKinematics(robot)
        kinematics.update(robot.landing)
        middle = kinematics.world_M_ankle.rotation @ kinematics.ankle_p_soles[0]
        # The last two joints of a leg; the twist of its foot, angular part below the linear one.
        legs = (kinematics.J_left, kinematics.J_right)
        pitch, roll = (
            [kinematics.base_rotation[axis] @ leg[3:, joint] for leg in legs]
            for axis, joint in ((1, -2), (0, -1))
        )
        turns = np.round(np.column_stack((pitch, roll)))
        return cls(height=-float(middle[2]), to_middle=float(middle[0]), turns=turns)


@compiled
def carry(
    state: Block,
    joints: NDArray[np.int64],
    cop: Array,
    pull: Array,
    ankles: Block,
    torque: Array,
) -> None:
    """Add what puts the CoP of each foot where it shall be.

    The normal force of a foot has the lever of its CoP; its horizontal force, which pulls the CoM,
    has the height of the ankle.

    Args:
        state: The believed state.
        joints: (2, 2) of :func:`ankle_joints`.
        cop: (2,) CoP of a foot, forward and left of the middle of its sole (m).
        pull: (2,) horizontal over normal force, forward and left.
        ankles: Block of :class:`Ankles`.
        torque: (n,) joint torques (Nm), which this adds to.
    """
    a = ankles[0]
    forward = a.to_middle + cop[0] + a.height * pull[0]
    left = cop[1] + a.height * pull[1]
    for foot in range(2):
        load = max(state[0].foot_force[foot], 0.0)
        torque[joints[foot, 0]] += a.turns[foot, 0] * load * forward
        torque[joints[foot, 1]] -= a.turns[foot, 1] * load * left
