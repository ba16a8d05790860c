"""How lists of tasks and limits become a QP."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.config import SolverName
from icub_jump_env.control.qp.problem import QPReport, QPSolution, QuadraticProgram
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.control.tasks.task import DiagonalTask, Limit, LimitBuffers, Task
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint

Array = NDArray[np.float64]

_UNBOUNDED = 1e6


class TaskQP:
    """A QP made of tasks; which list a task stands in decides what it is.

    Attributes:
        problem: The QP; its rows are those of the limits, then of the hard tasks.
    """

    def __init__(
        self,
        n_variables: int,
        *,
        costs: Sequence[DiagonalTask],
        soft: Sequence[Task],
        hard: Sequence[Task],
        limits: Sequence[Limit],
        solver: SolverName,
    ) -> None:
        """Set up the QP.

        Args:
            n_variables: Number of unknowns.
            costs: Costs on the unknowns themselves.
            soft: Equations whose weighted residual is a cost.
            hard: Equations that must hold.
            limits: Inequalities.
            solver: QP solver.
        """
        self._terms = n_variables, costs, soft, hard, limits, solver
        n = n_variables
        n_rows, n_equalities = (sum(term.size for term in terms) for terms in (limits, hard))
        self.problem = problem = QuadraticProgram(n, n_rows, n_equalities)
        problem.lower[: n + n_rows], problem.upper[: n + n_rows] = -_UNBOUNDED, _UNBOUNDED
        self._solver = CheckedSolver(solver, problem)
        self._costs = [(cost, problem.g[: len(cost.diagonal)]) for cost in costs]
        self._diagonal = np.zeros(n)
        for cost in costs:
            self._diagonal[: len(cost.diagonal)] += cost.diagonal
        self._H_diagonal = problem.H.reshape(-1)[:: n + 1]
        self._H_diagonal[:] = self._diagonal  # for good, where no task is soft

        self._rows = np.zeros((sum(task.size for task in soft), n))
        self._target = np.zeros(len(self._rows))
        self._soft = []
        first = 0
        for task in soft:
            task.scale = math.sqrt(task.weight)
            span = slice(first, first := first + task.size)
            self._soft.append((task, self._rows[span], self._target[span]))

        self._limits = []
        first = 0
        for limit in limits:
            span = slice(first, first := first + limit.size)
            shifted = slice(n + span.start, n + span.stop)
            buffers = LimitBuffers(
                problem.lower[:n],
                problem.upper[:n],
                problem.C[span],
                problem.lower[shifted],
                problem.upper[shifted],
            )
            limit.prepare(buffers)
            self._limits.append((limit, buffers))

        self._equalities = problem.lower[n + n_rows :]
        self._equalities_too = problem.upper[n + n_rows :]
        self._hard = []
        for task in hard:
            span = slice(first, first := first + task.size)
            target = problem.lower[n + span.start : n + span.stop]
            self._hard.append((task, problem.C[span], target))

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        # The buffers are views of one another; a copy takes its own and fills them anew.
        return _rebuild, self._terms

    def solve(self, state: RobotState, setpoint: Setpoint) -> tuple[QPSolution, QPReport]:
        """Pose the QP and solve it; apply the solution only if the report allows."""
        self.pose(state, setpoint)
        return self._solver.solve()

    def pose(self, state: RobotState, setpoint: Setpoint) -> None:
        """Write all terms into the problem."""
        problem, rows, target = self.problem, self._rows, self._target
        gradient = problem.g
        gradient.fill(0.0)
        for cost, part in self._costs:
            cost.subtract(state, setpoint, part)
        for task, task_rows, task_target in self._soft:
            task.write(state, setpoint, task_rows, task_target)
        if self._soft:
            np.matmul(rows.T, rows, out=problem.H)
            self._H_diagonal += self._diagonal
            gradient -= target.dot(rows)

        for limit, buffers in self._limits:
            limit.write(state, buffers)
        for task, task_rows, task_target in self._hard:
            task.write(state, setpoint, task_rows, task_target)
        self._equalities_too[:] = self._equalities


def _rebuild(
    n_variables: int,
    costs: Sequence[DiagonalTask],
    soft: Sequence[Task],
    hard: Sequence[Task],
    limits: Sequence[Limit],
    solver: SolverName,
) -> TaskQP:
    return TaskQP(n_variables, costs=costs, soft=soft, hard=hard, limits=limits, solver=solver)
