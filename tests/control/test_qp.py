"""Solvers against each other, and the check that does not trust them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.qp import solvers
from icub_jump_env.control.qp.check import check_solution
from icub_jump_env.control.qp.equalities import EqualitySolution, solve_equalities
from icub_jump_env.control.qp.problem import (
    IDLE,
    QPReport,
    QPResiduals,
    QPSolution,
    QPStatus,
    QPTolerances,
    QuadraticProgram,
    worse,
)
from icub_jump_env.control.qp.solvers import SOLVERS, CheckedSolver, make_solver

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
@pytest.mark.fault("broken programs")
def test_infeasible_problems_are_not_solved(name):
    problem = random_problem(3)
    problem.C[-1] = problem.C[-2]
    problem.lower[-1] = problem.upper[-1] = problem.upper[-2] + 1.0
    assert make_solver(name, problem).solve().status is not QPStatus.SOLVED


def poisoned(field, value):
    problem = random_problem(3)
    getattr(problem, field).flat[0] = value
    return problem


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_what_is_refused_at_once_takes_no_iteration(name):
    problem = random_problem(3)
    problem.lower[0] = problem.upper[0] + 1.0
    solution = make_solver(name, problem).solve()
    assert solution.status is not QPStatus.SOLVED
    assert (solution.iterations, *solution.x) == (0,) * (1 + problem.n)


@pytest.mark.parametrize("built_before", [True, False])
@pytest.mark.parametrize(
    ("field", "value"),
    [*((field, np.nan) for field in ("H", "g", "C", "lower", "upper")),
     ("H", np.inf), ("g", np.inf), ("C", -np.inf), ("H", -1e6), ("lower", 5.0)],
)  # fmt: skip
@pytest.mark.fault("broken programs")
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


@pytest.mark.parametrize("kind", QPResiduals._fields)
def test_each_residual_alone_has_a_solution_refused(kind):
    tolerances = QPTolerances(1e-8, 1e-8, 1e-6)
    at_the_edge = QPResiduals(*tolerances)
    assert tolerances.accept(at_the_edge)
    for value in (1.01 * getattr(tolerances, kind), np.nan, np.inf):
        assert not tolerances.accept(at_the_edge._replace(**{kind: value}))


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_a_feasible_stationary_point_that_is_not_optimal_is_rejected(name):
    """Multipliers of bounds that are not active can make any point stationary: the gap tells."""
    problem = random_problem(0)
    problem.C[:] = 0.0
    problem.lower[problem.n :], problem.upper[problem.n :] = -1.0, 1.0
    problem.lower[-problem.n_equalities :] = problem.upper[-problem.n_equalities :] = 0.0
    checked = CheckedSolver(name, problem)

    class Lying:
        tolerances = checked._solver.tolerances

        def solve(self):
            multipliers = np.concatenate((-problem.g, np.zeros(len(problem.C))))
            return QPSolution(np.zeros(problem.n), multipliers, QPStatus.SOLVED, 1)

    checked._solver = Lying()
    _, report = checked.solve()
    assert report.residuals.primal == 0.0
    assert report.residuals.dual < 1e-12
    assert report.residuals.gap > 1.0
    assert report.status is QPStatus.REJECTED
    assert report.failed


def test_the_worse_of_two_reports_is_the_failed_one_then_the_less_exact():
    exact, rough = (QPReport(QPStatus.SOLVED, QPResiduals(r, r, r), 1) for r in (1e-12, 1e-9))
    failed = exact._replace(status=QPStatus.REJECTED)
    for better, bad in ((exact, rough), (rough, failed), (IDLE, exact), (exact, failed)):
        assert worse(better, bad) is worse(bad, better) is bad


def without_active_inequalities():
    problem = random_problem(0)
    others = slice(problem.lower.size - problem.n_equalities)
    problem.lower[others], problem.upper[others] = -1e6, 1e6
    return problem


class TestClosedForm:
    """Where no inequality is active."""

    @given(seeds, st.sampled_from([0.0, 1e-3, 0.1, 1.0]), st.integers(0, 3))
    def test_it_is_the_solution_or_an_inequality_is_active(self, seed, pull, equalities):
        problem = random_problem(seed, equalities=equalities)
        problem.g *= pull
        expected = make_solver("daqp", problem).solve()
        found = EqualitySolution(problem)
        inequalities = slice(problem.lower.size - equalities)
        is_active = bool(expected.multipliers[inequalities].any())
        assert solve_equalities(problem.block, found.block) is not is_active
        if not is_active:
            np.testing.assert_allclose(found.x, expected.x, atol=1e-9)
            np.testing.assert_allclose(found.multipliers, expected.multipliers, atol=1e-8)

    @pytest.mark.parametrize("field", ["H", "g", "C", "lower", "upper"])
    def test_what_is_no_number_has_none(self, field):
        problem = poisoned(field, np.nan)
        assert not solve_equalities(problem.block, EqualitySolution(problem).block)

    def test_what_is_not_convex_or_contradicts_itself_has_none(self):
        concave, contradictory = poisoned("H", -1e6), random_problem(3)
        contradictory.C[-1] = contradictory.C[-2]
        for problem in (concave, contradictory):
            assert not solve_equalities(problem.block, EqualitySolution(problem).block)

    @pytest.mark.parametrize(("name", "iterates"), [("daqp", False), ("osqp", True)])
    def test_it_stands_in_for_the_default_solver_alone(self, name, iterates):
        problem = without_active_inequalities()
        _, report = CheckedSolver(name, problem).solve()
        assert report.status is QPStatus.SOLVED
        assert (report.iterations > 0) is iterates

    def test_what_the_check_refuses_is_solved_again(self, monkeypatch):
        problem = without_active_inequalities()
        expected, _ = CheckedSolver("daqp", problem).solve()

        def wrong(problem, found):
            found["x"] = expected.x + 1e-3
            return True

        monkeypatch.setattr(solvers, "solve_equalities", wrong)
        solution, report = CheckedSolver("daqp", problem).solve()
        assert report.status is QPStatus.SOLVED
        assert report.iterations > 0
        np.testing.assert_allclose(solution.x, expected.x, atol=1e-9)
