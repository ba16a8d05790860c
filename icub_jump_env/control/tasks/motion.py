"""The equations of motion of the base, six rows of eq. (1)."""

from __future__ import annotations

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block


@compiled
def base_motion(dynamics: Block, rows: Array, target: Array) -> None:
    """The rows of M nu_dot + h = B tau + J_f f that no motor drives.

    Args:
        dynamics: Equations of motion.
        rows: (6, n + 12) A, of joint accelerations and contact wrenches.
        target: (6,) b.
    """
    for i in range(6):
        target[i] = dynamics.base_bias[i]
        for j in range(rows.shape[1]):
            rows[i, j] = dynamics.base_rows[i, j]
