"""QP solvers behind one interface: DAQP (default) and OSQP."""

from __future__ import annotations

from typing import Protocol

import daqp
import numpy as np
import scipy.sparse as sp

from icub_jump_env.control.config import SolverName
from icub_jump_env.control.qp.check import check_solution
from icub_jump_env.control.qp.equalities import EqualitySolution, solve_equalities
from icub_jump_env.control.qp.problem import (
    QPReport,
    QPSolution,
    QPStatus,
    QPTolerances,
    QuadraticProgram,
)


class QPSolver(Protocol):
    """Solves the QP it was made for, as its buffers stand, without memory of earlier ones."""

    tolerances: QPTolerances

    def solve(self) -> QPSolution:
        """Solve the problem as it stands."""
        ...


class DAQPSolver:
    """Dual active-set solver; exact to rounding, fast, cold-started at each tick."""

    tolerances = QPTolerances(primal=1e-8, dual=1e-8, gap=1e-6)

    _EQUALITY = 5
    _INFEASIBLE = -1

    def __init__(self, problem: QuadraticProgram) -> None:
        self._problem = problem
        rows = problem.lower.size
        self._sense = np.zeros(rows, dtype=np.int32)
        self._sense[rows - problem.n_equalities :] = self._EQUALITY
        # A failed setup leaves DAQP unusable, so it sees a problem that cannot fail; each
        # solve replaces all of it.
        n, m = problem.n, problem.C.shape[0]
        ones = np.ones(rows)
        self._model = daqp.Model()
        self._model.setup(np.eye(n), np.zeros(n), np.zeros((m, n)), ones, -ones)

    def __reduce__(self) -> tuple[type[DAQPSolver], tuple[QuadraticProgram]]:
        return DAQPSolver, (self._problem,)

    def solve(self) -> QPSolution:
        """Solve the problem as it stands."""
        p = self._problem
        # Passing the constraint senses discards the previous active set.
        flag = self._model.update(p.H, p.g, p.C, p.upper, p.lower, self._sense)
        if flag < 0:
            status = QPStatus.INFEASIBLE if flag == self._INFEASIBLE else QPStatus.SOLVER_ERROR
            return QPSolution(np.zeros(p.n), np.zeros(p.lower.size), status, 0)
        x, _, flag, info = self._model.solve()
        if flag > 0:
            status = QPStatus.SOLVED
        else:
            status = QPStatus.INFEASIBLE if flag == self._INFEASIBLE else QPStatus.SOLVER_ERROR
        return QPSolution(x, info["lam"], status, info["iterations"])


class OSQPSolver:
    """Operator-splitting solver; its structure is set up once, the iterate reset each time."""

    tolerances = QPTolerances(primal=1e-6, dual=1e-6, gap=1e-4)

    _RHO = 1.0

    def __init__(self, problem: QuadraticProgram) -> None:
        import osqp  # takes long, and the default solver needs none of it

        self._problem = problem
        n, m = problem.n, problem.C.shape[0]
        # OSQP wants the upper triangle, column by column, with a fixed pattern.
        rows, cols = np.triu_indices(n)
        order = np.lexsort((rows, cols))
        self._upper_triangle = rows[order], cols[order]
        P = sp.csc_matrix((np.ones(order.size), self._upper_triangle), shape=(n, n))
        pattern = np.vstack((np.eye(n), np.ones((m, n))))
        A = sp.csc_matrix(pattern)
        A.sort_indices()
        self._A_entries = A.indices, np.repeat(np.arange(n), np.diff(A.indptr))
        self._stacked = np.vstack((np.eye(n), np.zeros((m, n))))
        self._zero_x, self._zero_y = np.zeros(n), np.zeros(n + m)
        self._solver = osqp.OSQP()
        self._solver.setup(
            P,
            np.zeros(n),
            A,
            np.zeros(n + m),
            np.zeros(n + m),
            eps_abs=1e-9,
            eps_rel=1e-9,
            max_iter=20000,
            rho=self._RHO,
            verbose=False,
            # The cost weights span five decades; OSQP's own scaling makes that worse.
            scaling=0,
        )

    def __reduce__(self) -> tuple[type[OSQPSolver], tuple[QuadraticProgram]]:
        return OSQPSolver, (self._problem,)

    def solve(self) -> QPSolution:
        """Solve the problem as it stands."""
        p = self._problem
        if not self._solvable():
            return QPSolution(np.zeros(p.n), np.zeros(p.lower.size), QPStatus.SOLVER_ERROR, 0)
        self._stacked[p.n :] = p.C
        self._solver.update(
            Px=p.H[self._upper_triangle],
            Ax=self._stacked[self._A_entries],
            q=p.g,
            l=p.lower,
            u=p.upper,
        )
        # OSQP keeps its last iterate and step size; without these two lines its answer
        # would depend on the problems before.
        self._solver.update_settings(rho=self._RHO)
        self._solver.warm_start(x=self._zero_x, y=self._zero_y)
        result = self._solver.solve(raise_error=False)
        if result.info.status == "solved":
            status = QPStatus.SOLVED
        elif "infeasible" in result.info.status:
            status = QPStatus.INFEASIBLE
        else:
            status = QPStatus.SOLVER_ERROR
        return QPSolution(
            np.asarray(result.x), np.asarray(result.y), status, int(result.info.iter)
        )

    def _solvable(self) -> bool:
        """Whether OSQP takes the problem; else it prints a complaint, whatever its settings."""
        p = self._problem
        if not all(np.isfinite(x).all() for x in (p.H, p.g, p.C)):
            return False
        try:
            # The bounds on the variables add rho to the diagonal of what OSQP factorises.
            np.linalg.cholesky(p.H + self._RHO * np.eye(p.n))
        except np.linalg.LinAlgError:
            return False
        return bool((p.lower <= p.upper).all())


SOLVERS: dict[SolverName, type[DAQPSolver] | type[OSQPSolver]] = {
    "daqp": DAQPSolver,
    "osqp": OSQPSolver,
}


class CheckedSolver:
    """A solver whose answers are checked outside of it: its failures are data."""

    def __init__(self, name: SolverName, problem: QuadraticProgram) -> None:
        self._problem = problem
        self._solver = make_solver(name, problem)
        # A user who asks for OSQP wants to see what it does.
        self._closed = EqualitySolution(problem) if name == "daqp" else None

    def solve(self) -> tuple[QPSolution, QPReport]:
        """Solve the problem as it stands; apply the solution only if the report allows."""
        closed = self._closed
        if closed is not None and solve_equalities(self._problem.block, closed.block):
            found = self._check(QPSolution(closed.x, closed.multipliers, QPStatus.SOLVED, 0))
            if not found[1].failed:
                return found
        return self._check(self._solver.solve())

    def _check(self, solution: QPSolution) -> tuple[QPSolution, QPReport]:
        residuals = check_solution(self._problem, solution)
        status = solution.status
        if status is QPStatus.SOLVED and not self._solver.tolerances.accept(residuals):
            status = QPStatus.REJECTED
        return solution, QPReport(status, residuals, solution.iterations)


def make_solver(name: SolverName, problem: QuadraticProgram) -> QPSolver:
    """The solver called ``name``, set up for the size and pattern of ``problem``."""
    return SOLVERS[name](problem)
