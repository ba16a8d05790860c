"""Quadratic programs drawn at random, whole and broken, against two other solvers.

Clarabel and PIQP are interior-point solvers, of another kind than DAQP and OSQP. What ours call
solved is applied to a robot, so it must be what they find; what has no solution must never be.
"""

import clarabel
import numpy as np
import piqp
import pytest
import scipy.sparse as sp

from icub_jump_env.control.qp.problem import QPStatus, QuadraticProgram
from icub_jump_env.control.qp.solvers import CheckedSolver

SOLVABLE = ("plain", "scaled", "flat", "degenerate")
BROKEN = ("contradictory", "outside", "poisoned")
SIZES = ((4, 1, 1), (9, 11, 2), (16, 5, 5), (29, 8, 3))
"""Variables, inequalities and equalities; few, as the solver is compiled for each."""


def drawn(kind, rng):
    """A program of a size like the controllers', whole or broken in some way."""
    n, inequalities, equalities = rng.choice(SIZES)
    problem = QuadraticProgram(n, inequalities, equalities)
    root = rng.normal(size=(n, n))
    problem.H[:] = root @ root.T + 0.1 * np.eye(n)
    problem.g[:] = 10.0 * rng.normal(size=n)
    problem.C[:] = rng.normal(size=problem.C.shape)
    inside = rng.uniform(-0.9, 0.9, n)
    rows = problem.C @ inside
    problem.lower[:n], problem.upper[:n] = -1.0, 1.0
    problem.lower[n:], problem.upper[n:] = rows - 0.5, rows + 0.5
    equal = slice(problem.lower.size - problem.n_equalities, None)
    problem.lower[equal] = problem.upper[equal] = rows[rows.size - problem.n_equalities :]
    if kind == "scaled":  # weights from 1 to 1e5, as the controllers have
        weights = 10.0 ** rng.uniform(0.0, 2.5, n)
        problem.H[:] *= np.outer(weights, weights)
        problem.g[:] *= weights
    elif kind == "flat":  # one direction of almost no cost
        problem.H[:] = np.outer(root[0], root[0]) + 1e-6 * np.eye(n)
    elif kind == "degenerate":  # the same row twice
        problem.C[0], problem.lower[n], problem.upper[n] = (
            problem.C[-1],
            rows[-1] - 0.5,
            rows[-1] + 0.5,
        )
    elif kind == "contradictory":  # a row that has to be two things
        problem.C[0] = problem.C[-1]
        problem.lower[n], problem.upper[n] = rows[-1] + 0.5, rows[-1] + 1.0
    elif kind == "outside":  # an equality that no point within the bounds meets
        problem.lower[-1] = problem.upper[-1] = 1.1 * np.abs(problem.C[-1]).sum()
    elif kind == "poisoned":
        name = rng.choice(["H", "g", "C", "lower", "upper"])
        poison = [np.nan] if name in ("lower", "upper") else [np.nan, np.inf, -np.inf]
        field = getattr(problem, name)
        field.flat[rng.integers(field.size)] = rng.choice(poison)
    return problem


def by_clarabel(problem):
    """Its minimum, or None."""
    n = problem.n
    rows = np.vstack((np.eye(n), problem.C))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        sp.csc_matrix(np.triu(problem.H)),
        problem.g,
        sp.csc_matrix(np.vstack((rows, -rows))),
        np.concatenate((problem.upper, -problem.lower)),
        [clarabel.NonnegativeConeT(2 * len(rows))],
        settings,
    ).solve()
    return np.array(solution.x) if str(solution.status) == "Solved" else None


def by_piqp(problem):
    """Its minimum, or None."""
    n = problem.n
    rows, split = problem.C, len(problem.C) - problem.n_equalities
    lower, upper = problem.lower[n:], problem.upper[n:]
    solver = piqp.DenseSolver()
    solver.settings.verbose = False
    solver.setup(
        problem.H, problem.g, rows[split:], upper[split:], rows[:split], lower[:split],
        upper[:split], problem.lower[:n], problem.upper[:n],
    )  # fmt: skip
    return solver.result.x.copy() if solver.solve() == piqp.PIQP_SOLVED else None


def cost(problem, x):
    return 0.5 * x @ problem.H @ x + problem.g @ x


def excess(problem, x):
    """By how much a point leaves the bounds, of variables or rows."""
    values = np.concatenate((x, problem.C @ x))
    return max((problem.lower - values).max(), (values - problem.upper).max())


LEAST_SOLVED = {"daqp": 1.0, "osqp": 0.9}
"""Share of the cases; the rest is told as failed."""


@pytest.mark.fault("broken programs")
@pytest.mark.parametrize("name", LEAST_SOLVED)
@pytest.mark.parametrize("kind", [*SOLVABLE, *BROKEN])
def test_what_is_called_solved_is_what_others_find(many, kind, name):
    solved, cases = 0, many(20, 500)
    for seed in range(cases):
        problem = drawn(kind, np.random.default_rng(seed))
        solution, report = CheckedSolver(name, problem).solve()
        if report.failed:
            continue
        solved += 1
        assert report.status is QPStatus.SOLVED
        assert excess(problem, solution.x) <= 1e-5
        for other in (by_clarabel(problem), by_piqp(problem)):
            assert other is not None
            scale = 1.0 + abs(cost(problem, other))
            assert abs(cost(problem, solution.x) - cost(problem, other)) <= 1e-4 * scale
    if kind in BROKEN:
        assert solved == 0
    else:
        assert solved >= LEAST_SOLVED[name] * cases
