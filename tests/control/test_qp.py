"""Solvers against each other, and the check that does not trust them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.qp.problem import QPSolution, QPStatus, QuadraticProgram, check_solution
from icub_jump_env.control.qp.solvers import SOLVERS, make_solver

seeds = st.integers(0, 10_000)


def random_problem(seed, n=12, inequalities=4, equalities=3):
    rng = np.random.default_rng(seed)
    problem = QuadraticProgram(n, inequalities, equalities)
    fill(problem, rng)
    return problem


def fill(problem, rng):
    n = problem.n
    root = rng.normal(size=(n, n))
    problem.H[:] = root @ root.T + 0.1 * np.eye(n)
    problem.g[:] = 10 * rng.normal(size=n)
    problem.C[:] = rng.normal(size=problem.C.shape)
    inside = np.clip(rng.normal(size=n), -0.9, 0.9)
    rows = problem.C @ inside
    problem.lower[:n], problem.upper[:n] = -1.0, 1.0
    problem.lower[n:], problem.upper[n:] = rows - 0.5, rows + 0.5
    equal = slice(problem.lower.size - problem.n_equalities, None)
    problem.lower[equal] = problem.upper[equal] = rows[rows.size - problem.n_equalities :]


@given(seeds)
def test_solvers_agree(seed):
    problem = random_problem(seed)
    daqp, osqp = (make_solver(name, problem).solve() for name in ("daqp", "osqp"))
    assert daqp.status is osqp.status is QPStatus.SOLVED
    np.testing.assert_allclose(daqp.x, osqp.x, atol=1e-5)


@given(seeds, st.sampled_from(sorted(SOLVERS)))
def test_residuals_of_a_solution_are_small(seed, name):
    problem = random_problem(seed)
    solver = make_solver(name, problem)
    residuals = check_solution(problem, solver.solve())
    for kind in ("primal", "dual", "gap"):
        assert getattr(residuals, kind) <= getattr(solver.tolerances, kind)


@given(seeds, st.integers(0, 11))
def test_check_notices_a_wrong_point(seed, index):
    problem = random_problem(seed)
    solution = make_solver("daqp", problem).solve()
    x = solution.x.copy()
    x[index] += 1e-3
    residuals = check_solution(problem, solution._replace(x=x))
    assert max(residuals) > 1e-6


@given(seeds)
def test_check_notices_wrong_multipliers(seed):
    problem = random_problem(seed)
    solution = make_solver("daqp", problem).solve()
    residuals = check_solution(problem, solution._replace(multipliers=-solution.multipliers))
    assert residuals.dual > 1e-6 or not solution.multipliers.any()


def test_check_passes_nan_on():
    problem = random_problem(0)
    nan = np.full(problem.n, np.nan)
    solution = QPSolution(nan, np.zeros(problem.lower.size), QPStatus.SOLVED, 1)
    assert np.isnan(check_solution(problem, solution).dual)


@given(seeds, st.sampled_from(sorted(SOLVERS)))
def test_answers_do_not_depend_on_earlier_problems(seed, name):
    """Bit for bit: warm starts and step sizes must not leak from one tick to the next."""
    fresh = make_solver(name, random_problem(seed)).solve()
    problem = random_problem(seed + 1)
    used = make_solver(name, problem)
    used.solve()
    fill(problem, np.random.default_rng(seed + 2))
    used.solve()
    fill(problem, np.random.default_rng(seed))
    again = used.solve()
    np.testing.assert_array_equal(again.x, fresh.x)
    np.testing.assert_array_equal(again.multipliers, fresh.multipliers)


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_infeasible_problems_are_not_solved(name):
    problem = random_problem(3)
    problem.C[-1] = problem.C[-2]
    problem.lower[-1] = problem.upper[-1] = problem.upper[-2] + 1.0
    assert make_solver(name, problem).solve().status is not QPStatus.SOLVED


def poisoned(field, value):
    problem = random_problem(3)
    getattr(problem, field).flat[0] = value
    return problem


@pytest.mark.parametrize("built_before", [True, False])
@pytest.mark.parametrize(
    ("field", "value"),
    [*((field, np.nan) for field in ("H", "g", "C", "lower", "upper")),
     ("H", np.inf), ("g", np.inf), ("C", -np.inf), ("H", -1e6), ("lower", 5.0)],
)  # fmt: skip
def test_a_problem_without_solution_prints_nothing(capfd, field, value, built_before):
    """OSQP complains on stdout even if told to be silent."""
    poison = poisoned(field, value)
    problem = random_problem(3)
    solver = make_solver("osqp", problem if built_before else poison)
    if built_before:
        for name in ("H", "g", "C", "lower", "upper"):
            getattr(problem, name)[:] = getattr(poison, name)
    assert solver.solve().status is not QPStatus.SOLVED
    assert capfd.readouterr() == ("", "")
