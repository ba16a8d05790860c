"""The CoM task: (3b) in velocities, (6b) in accelerations.

Like all equations of this package each is a compiled function that writes its rows A and its right
side b into buffers of the QP, both times ``scale``: 1 for a constraint, the root of its weight for
a cost.
"""

from __future__ import annotations

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import rotate_back
from icub_jump_env.records import Array, Block
from icub_jump_env.robot.icub import GRAVITY


@compiled
def com_velocity(
    model: Block,
    setpoint: Block,
    gain: float,
    scale: float,
    rows: Array,
    target: Array,
) -> None:
    """J_c nu = x_dot_dc - K (x - x_dc), eq. (3b).

    The CoM is that of the joints with both feet at rest, as the whole of eq. 3. Where a push turns
    the robot about the edges of its feet, the joints cannot bring the CoM back: to try it makes
    the robot rotate.

    Args:
        model: Kinematics of both feet at rest.
        setpoint: What to track.
        gain: K (1/s).
        scale: Root of the weight (s/m).
        rows: (3, n) A, of the joint velocities.
        target: (3,) b.
    """
    for i in range(3):
        error = model.com[i] - setpoint.com_position[i]
        target[i] = scale * (setpoint.com_velocity[i] - gain * error)
        for j in range(rows.shape[1]):
            rows[i, j] = scale * model.centroidal_map[i, j]


@compiled
def com_acceleration(
    dynamics: Block,
    state: Block,
    setpoint: Block,
    stiffness: float,
    damping: float,
    scale: float,
    rows: Array,
    target: Array,
) -> None:
    """J_c nu_dot + J_c_dot nu = x_ddot_dc - [K_p K_d] (x - x_dc, x_dot - x_dot_dc), eq. (6b).

    By Newton's law it reads F / m + g = x_ddot for the total contact force F, which makes it
    rows on the contact wrenches alone, here in the axes of the base. The paper prints the
    gains as diag(K_p, K_d), which would return six numbers for three.

    Args:
        dynamics: Equations of motion.
        state: The believed state.
        setpoint: What to track.
        stiffness: K_p (1/s^2).
        damping: K_d (1/s).
        scale: Root of the weight (s^2/m).
        rows: (3, n + 12) A, of joint accelerations and contact wrenches.
        target: (3,) b.
    """
    first = rows.shape[1] - 12
    wanted = np.empty(3)
    for i in range(3):
        error = state.com[i] - setpoint.com_position[i]
        rate = state.com_velocity[i] - setpoint.com_velocity[i]
        wanted[i] = scale * (setpoint.com_acceleration[i] - stiffness * error - damping * rate)
        for j in range(12):
            rows[i, first + j] = scale / dynamics.total_mass * dynamics.force_rows[i, j]
    wanted[2] += scale * GRAVITY
    rotate_back(state.base_rotation, wanted, target)
