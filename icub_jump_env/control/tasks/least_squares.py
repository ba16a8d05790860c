"""How equations whose residual is a cost enter the QP."""

from __future__ import annotations

from icub_jump_env.compiled import compiled
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
        for j in range(i, n):
            hessian[i, j] = 0.0
        hessian[i, i] = diagonal[i]
    for row in range(target.shape[0]):
        for i in range(n):
            factor = rows[row, i]
            gradient[i] -= factor * target[row]
            for j in range(i, n):
                hessian[i, j] += factor * rows[row, j]
    for i in range(n):
        for j in range(i):
            hessian[i, j] = hessian[j, i]
