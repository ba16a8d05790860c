"""Conversions between MuJoCo's and Pinocchio's coordinates of the floating base.

============  =========================  ========================
of the base   MuJoCo free joint          Pinocchio free-flyer
============  =========================  ========================
position      world                      world
orientation   quaternion wxyz            quaternion xyzw
linear vel.   of the base origin, world  of the base origin, base
angular vel.  base                       base
============  =========================  ========================
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from icub_jump_env.compiled import compiled

Array = NDArray[np.float64]

_WXYZ = [6, 3, 4, 5]
_XYZW = [4, 5, 6, 3]


@compiled
def heading(base_rotation: Array) -> tuple[float, float]:
    """Cosine and sine of the yaw of where a base ((3, 3), world) faces: its own -x."""
    x, y = -base_rotation[0, 0], -base_rotation[1, 0]
    length = math.hypot(x, y)
    return x / length, y / length


def mujoco_qpos(q: Array) -> Array:
    """MuJoCo positions (30,) of Pinocchio's configuration ``q`` (30,)."""
    return np.concatenate((q[:3], q[_WXYZ], q[7:]))


def pinocchio_q(qpos: Array) -> Array:
    """Pinocchio's configuration (30,) of MuJoCo positions (30,)."""
    return np.concatenate((qpos[:3], qpos[_XYZW], qpos[7:]))


def mujoco_qvel(q: Array, v: Array) -> Array:
    """MuJoCo velocities (29,) of Pinocchio's ``v`` (29,) at ``q`` (30,)."""
    return np.concatenate((_rotation(q).apply(v[:3]), v[3:]))


def pinocchio_v(q: Array, qvel: Array) -> Array:
    """Pinocchio's velocities (29,) of MuJoCo's ``qvel`` (29,) at ``q`` (30,)."""
    return np.concatenate((_rotation(q).apply(qvel[:3], inverse=True), qvel[3:]))


def _rotation(q: Array) -> Rotation:
    return Rotation.from_quat(q[3:7])
