"""Closeness to the previous command, second term of (3a) and (6a)."""

from __future__ import annotations

import math

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block


@compiled
def velocity_smoothness(previous: Array, weight: Array, gradient: Array) -> None:
    """1/2 ||s_dot - s_dot_{k-1}||^2_Delta, eq. (3a).

    Args:
        previous: (n,) the previous command (rad/s).
        weight: (n,) diagonal of Delta, which the Hessian has already.
        gradient: (n,) from which this subtracts Delta s_dot_{k-1}.
    """
    for j in range(weight.shape[0]):
        gradient[j] -= weight[j] * previous[j]


@compiled
def torque_smoothness(
    dynamics: Block, previous: Array, weight: Array, rows: Array, target: Array
) -> None:
    """1/2 ||tau - tau_{k-1}||^2_Delta, eq. (6a); tau is affine in the unknowns.

    The paper's text speaks of the difference of accelerations; we take the formula.

    Args:
        dynamics: Equations of motion.
        previous: (n,) the previous torques (Nm).
        weight: (n,) diagonal of Delta (Nm^-2).
        rows: (n, n + 12) sqrt(Delta) times the map from the unknowns to tau.
        target: (n,) sqrt(Delta) times what that has to give.
    """
    for i in range(weight.shape[0]):
        root = math.sqrt(weight[i])
        target[i] = root * (previous[i] - dynamics.torque_bias[i])
        for j in range(rows.shape[1]):
            rows[i, j] = root * dynamics.torque_rows[i, j]
