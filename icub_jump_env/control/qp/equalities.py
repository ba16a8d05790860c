"""The closed form of a QP whose inequalities are not active."""

from __future__ import annotations

from typing import Annotated

from icub_jump_env.compiled import compiled
from icub_jump_env.control.qp.problem import QuadraticProgram
from icub_jump_env.linear_algebra import (
    add_rows,
    cholesky,
    solve,
    solve_columns_transposed,
    solve_transposed,
)
from icub_jump_env.records import Array, Block, Record


class EqualitySolution(Record):
    """A solution with the room that it takes to find it; of n variables and e equalities.

    Attributes:
        x: (n,) primal variables.
        multipliers: (n + m,) of the bounds and rows; none but the equalities' differs from zero.
        factor: (n, n) upper, H = factor^T factor.
        columns: (n, e + 1) factor^-T times the equalities' rows, as columns, and the gradient.
        schur: (e, e) product of these rows.
    """

    x: Annotated[Array, ("n",)]
    multipliers: Annotated[Array, ("n + m",)]
    factor: Annotated[Array, ("n", "n")]
    columns: Annotated[Array, ("n", "e + 1")]
    schur: Annotated[Array, ("e", "e")]

    def __init__(self, problem: QuadraticProgram) -> None:
        n, rows, e = problem.n, len(problem.lower), problem.n_equalities
        super().__init__({"n": n, "n + m": rows, "e": e, "e + 1": e + 1})


@compiled
def solve_equalities(problem: Block, solution: Block) -> bool:
    """Solve a QP as if it had no inequalities.

    With H = U^T U, y = U x and the equalities A x = b it reads min 1/2 y^T y + (U^-T g)^T y
    subject to (A U^-1) y = b, whose multipliers follow from an (e, e) system.

    Args:
        problem: Block of the QP.
        solution: Block of the :class:`EqualitySolution`, which this fills.

    Returns:
        Whether it solves the QP: there is one solution, and it keeps the inequalities.
    """
    p, found = problem[0], solution[0]
    factor, columns, schur = found.factor, found.columns, found.schur
    n, m, e = p.g.shape[0], p.C.shape[0], schur.shape[0]
    if not cholesky(p.H, factor):
        return False
    for j in range(n):
        for a in range(e):
            columns[j, a] = p.C[m - e + a, j]
        columns[j, e] = p.g[j]
    solve_columns_transposed(factor, columns)
    multipliers = found.multipliers[n + m - e :]
    for a in range(e):
        multipliers[a] = p.lower[n + m - e + a]
        schur[a, a:] = 0.0
    for j in range(n):
        gradient = columns[j, e]
        for a in range(e):
            multipliers[a] += columns[j, a] * gradient
    for a in range(e):
        multipliers[a] = -multipliers[a]
        add_rows(1.0, columns[:, a], columns, a, schur[a, a:])
    if not cholesky(schur, schur):
        return False
    solve_transposed(schur, multipliers)
    solve(schur, multipliers)

    x = found.x
    for j in range(n):
        x[j] = -columns[j, e]
        for a in range(e):
            x[j] -= multipliers[a] * columns[j, a]
    solve(factor, x)
    for j in range(n):
        if not p.lower[j] <= x[j] <= p.upper[j]:
            return False
    for a in range(m - e):
        value = 0.0
        for j in range(n):
            value += p.C[a, j] * x[j]
        if not p.lower[n + a] <= value <= p.upper[n + a]:
            return False
    return True
