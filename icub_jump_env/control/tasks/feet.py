"""Feet at rest: (3c) in velocities, (6c) in accelerations.

The left foot is at rest by the choice of the unknowns; what is left is the right foot
relative to it.
"""

from __future__ import annotations

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block


@compiled
def feet_velocity(model: Block, lift: float, rows: Array, target: Array) -> None:
    """J_lf nu = J_rf nu = 0, eq. (3c); or the right sole rises, relative to the left one.

    Args:
        model: Kinematics of both feet at rest.
        lift: Vertical speed of the right sole, relative to the left one (m/s).
        rows: (6, n) A, of the joint velocities: left foot minus right foot, base axes.
        target: (6,) b.
    """
    for i in range(6):
        target[i] = -lift * model.base_rotation[2, i] if i < 3 else 0.0
        for j in range(model.J_feet.shape[1]):
            rows[i, j] = model.J_feet[i, j]


@compiled
def feet_acceleration(model: Block, dynamics: Block, rows: Array, target: Array) -> None:
    """J_lf nu_dot + J_lf_dot nu = 0 and the same of the right foot, eq. (6c).

    Args:
        model: Kinematics of both feet at rest.
        dynamics: Equations of motion.
        rows: (6, n + 12) A, of joint accelerations and contact wrenches.
        target: (6,) b.
    """
    for i in range(6):
        target[i] = dynamics.foot_bias[i]
        for j in range(model.J_feet.shape[1]):
            rows[i, j] = model.J_feet[i, j]
