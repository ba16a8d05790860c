"""The lean that the IMU feels as a jump begins, and what corrects the launch for it.

A robot on a slope, or with wrong encoders, leans: gravity in its IMU points elsewhere than it would
in the plan's crouch on level ground. It takes off leaning and lands leaning, and falls backward on a
slope that rises ahead. So the launch builds up an angular momentum that turns it the other way in
the air. A turn by the whole lean takes I / t per lean, where I is the inertia about the pitch axis
and t the time in the air: about 12 kg m^2/s per rad. Half of that is best: the landing catches
the rest, and momentum, too, is something to catch. A lean forward, where the toes are far, needs none.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from icub_jump_env.planning.residual import AXES, N_AXES
from icub_jump_env.records import Array
from icub_jump_env.robot.icub import BASE_YAW
from icub_jump_env.robot.statics import Stance

MOMENTUM_PER_LEAN = 6.0
"""Pitch momentum of the launch per lean backward (kg m^2/s per rad);
:mod:`experiments.lean_correction` tuned it for each controller, and found both alike."""

_BASE_R_IMU = pin.exp3(np.array([0.0, 0.0, BASE_YAW]))


def gravity_in_imu(stance: Stance) -> Array:
    """(3,) where gravity points in the IMU frame of a robot that stands as it is to."""
    rotation = pin.Quaternion(stance.configuration[3:7]).toRotationMatrix()
    gravity: Array = (rotation @ _BASE_R_IMU).T @ np.array([0.0, 0.0, -1.0])
    return gravity


def lean_of(gravity: Array, stance: Stance) -> Array:
    """The lean forward and to the left (rad), for small angles.

    Args:
        gravity: (3,) direction of gravity in the IMU frame, while the robot stands.
        stance: How it was to stand, on level ground.

    Returns:
        (2,) difference of the directions of gravity.
    """
    lean: Array = gravity[:2] - gravity_in_imu(stance)[:2]
    return lean


def lean_correction(gravity: Array, stance: Stance) -> Array:
    """What a residual would have to be against the lean, (5,) in the order of its axes."""
    target = np.zeros(N_AXES)
    target[AXES.index("pitch")] = MOMENTUM_PER_LEAN * max(0.0, -lean_of(gravity, stance)[0])
    return target
