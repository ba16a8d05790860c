"""How far the robot leans as a jump begins: what the IMU feels beside what the plan expects.

A slope of the ground and wrong encoders both show in it.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from icub_jump_env.records import Array
from icub_jump_env.robot.icub import BASE_YAW
from icub_jump_env.robot.statics import Stance

_BASE_R_IMU = pin.exp3(np.array([0.0, 0.0, BASE_YAW]))


def lean_of(gravity: Array, stance: Stance) -> Array:
    """The lean forward and to the left (rad), for small angles.

    Args:
        gravity: (3,) direction of gravity in the IMU frame, while the robot stands.
        stance: How it was to stand, on level ground.

    Returns:
        (2,) difference of the directions of gravity.
    """
    rotation = pin.Quaternion(stance.configuration[3:7]).toRotationMatrix()
    expected = (rotation @ _BASE_R_IMU).T @ np.array([0.0, 0.0, -1.0])
    lean: Array = gravity[:2] - expected[:2]
    return lean
