"""The check of a solution outside its solver."""

from __future__ import annotations

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.control.qp.problem import QPResiduals, QPSolution, QuadraticProgram
from icub_jump_env.linear_algebra import larger
from icub_jump_env.records import Array, Block


def check_solution(problem: QuadraticProgram, solution: QPSolution) -> QPResiduals:
    """Primal and dual residual and duality gap of a solution.

    Args:
        problem: The QP.
        solution: A claimed solution; NaN entries give NaN residuals.

    Returns:
        The residuals.
    """
    return QPResiduals(*residuals(problem.block, solution.x, solution.multipliers))


@compiled
def residuals(problem: Block, x: Array, multipliers: Array) -> tuple[float, float, float]:
    """The same of plain arrays: primal, dual and gap of :class:`QPResiduals`."""
    p = problem[0]
    n, m = p.g.shape[0], p.C.shape[0]
    slope = np.empty(n)
    primal = gap = cost = steepest = dual = 0.0
    for j in range(n):
        slope[j] = p.g[j] + multipliers[j]
        cost += p.g[j] * x[j]
        steepest = larger(steepest, abs(p.g[j]))
    for i in range(n):
        for j in range(n):
            slope[j] += x[i] * p.H[i, j]
    for row in range(n + m):
        value = 0.0
        if row < n:
            value = x[row]
        else:
            for j in range(n):
                value += p.C[row - n, j] * x[j]
                slope[j] += multipliers[row] * p.C[row - n, j]
        below, above = p.lower[row] - value, value - p.upper[row]
        primal = larger(primal, larger(below, above))
        # At the optimum each multiplier's bound is active; a wrong sign shows here.
        gap += abs(multipliers[row]) * abs(above if multipliers[row] > 0.0 else below)
    for j in range(n):
        dual = larger(dual, abs(slope[j]))
    return primal, dual / (1.0 + steepest), gap / (1.0 + abs(cost))
