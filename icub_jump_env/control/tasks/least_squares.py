"""How equations whose residual is a cost enter the QP."""

from __future__ import annotations

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import add_rows
from icub_jump_env.records import Array


@compiled
def least_squares(
    rows: Array, target: Array, diagonal: Array, hessian: Array, gradient: Array
) -> None:
    """Add 1/2 ||A x - b||^2 to a cost.

    Args:
        rows: (k, n) A.
        target: (k,) b.
        diagonal: (n,) what else stands on the diagonal of the Hessian.
        hessian: (n, n) A^T A plus the diagonal; this writes all of it.
        gradient: (n,) from which this subtracts A^T b.
    """
    n = gradient.shape[0]
    for i in range(n):
        for row in range(target.shape[0]):
            gradient[i] -= rows[row, i] * target[row]
        hessian[i, i:] = 0.0
        hessian[i, i] = diagonal[i]
        add_rows(1.0, rows[:, i], rows, i, hessian[i, i:])
        for j in range(i):
            hessian[i, j] = hessian[j, i]
