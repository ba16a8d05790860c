"""The constraint on the centroidal angular momentum: (3d) in velocities, (6d) in forces."""

from __future__ import annotations

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import rotate_back
from icub_jump_env.records import Array, Block


@compiled
def momentum_integral(
    model: Block,
    integral: Array,
    setpoint: Block,
    gain: float,
    scale: float,
    rows: Array,
    target: Array,
) -> None:
    """J_M^omega nu = H_d - K int (H_omega - H_d) dt, eq. (3d); the paper's H_d is zero.

    Args:
        model: Kinematics of both feet at rest.
        integral: (3,) the integral, which the controller sums up.
        setpoint: What to track.
        gain: K (1/s).
        scale: Root of the weight (s/(kg m^2)).
        rows: (3, n) A, of the joint velocities.
        target: (3,) b.
    """
    for i in range(3):
        target[i] = scale * (setpoint.angular_momentum[i] - gain * integral[i])
        for j in range(rows.shape[1]):
            rows[i, j] = scale * model.centroidal_map[3 + i, j]


@compiled
def momentum_rate(
    dynamics: Block,
    state: Block,
    setpoint: Block,
    gain: float,
    scale: float,
    rows: Array,
    target: Array,
) -> None:
    """A f = H_dot_d - K (H_omega - H_d), eq. (6d); the paper's H_d is zero.

    A f is the moment of the contact wrenches about the CoM, here in the axes of the base.

    Args:
        dynamics: Equations of motion.
        state: The believed state.
        setpoint: What to track.
        gain: K (1/s).
        scale: Root of the weight (Nm^-1).
        rows: (3, n + 12) A, of joint accelerations and contact wrenches.
        target: (3,) b.
    """
    first = rows.shape[1] - 12
    wanted = np.empty(3)
    for i in range(3):
        error = state.angular_momentum[i] - setpoint.angular_momentum[i]
        wanted[i] = scale * (setpoint.angular_momentum_rate[i] - gain * error)
        for j in range(12):
            rows[i, first + j] = scale * dynamics.moment_rows[i, j]
    rotate_back(state.base_rotation, wanted, target)
