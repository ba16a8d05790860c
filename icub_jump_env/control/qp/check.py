"""The check of a solution outside its solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.qp.problem import QPResiduals, QPSolution, QuadraticProgram

Array = NDArray[np.float64]

_largest = np.maximum.reduce
"""As ``ndarray.max``, without its detour through Python."""


def check_solution(problem: QuadraticProgram, solution: QPSolution) -> QPResiduals:
    """Primal and dual residual and duality gap of a solution.

    Args:
        problem: The QP.
        solution: A claimed solution; NaN entries give NaN residuals.

    Returns:
        The residuals.
    """
    n, g, x, multipliers = problem.n, problem.g, solution.x, solution.multipliers
    values = np.concatenate((x, problem.C.dot(x)))
    below, above = problem.lower - values, values - problem.upper
    primal = max(_largest(below), _largest(above))

    stationarity = problem.H.dot(x)
    stationarity += g
    stationarity += multipliers[:n]
    stationarity += multipliers[n:].dot(problem.C)
    dual = _largest(np.abs(stationarity)) / (1.0 + _largest(np.abs(g)))

    # At the optimum each multiplier's bound is active; a wrong sign shows here.
    slack = np.where(multipliers > 0, above, below)
    gap = np.abs(multipliers).dot(np.abs(slack)) / (1.0 + abs(g.dot(x)))
    return QPResiduals(max(float(primal), 0.0), float(dual), float(gap))
