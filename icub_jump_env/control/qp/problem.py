"""Quadratic programs as values, and what became of them.

Every controller of this package poses

    min_x  1/2 x^T H x + g^T x    subject to    lower <= (x, C x) <= upper,

with bounds on the variables first and rows of C after them; a row whose lower and
upper bounds are equal is an equality.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, NamedTuple

import numpy as np

from icub_jump_env.records import Array, Record

UNBOUNDED = 1e6
"""Stands for infinity in bounds, which OSQP and DAQP take as any number."""


class QuadraticProgram(Record):
    """Buffers of one QP of fixed size, rewritten in place at each control tick.

    Attributes:
        H: (n, n) Hessian, positive definite.
        g: (n,) gradient.
        C: (m, n) constraint rows.
        lower: (n + m,) lower bounds of x, then of C x.
        upper: (n + m,) upper bounds.
        n: Number of variables.
        n_equalities: The last ``n_equalities`` rows of C are equalities.
    """

    H: Annotated[Array, ("n", "n")]
    g: Annotated[Array, ("n",)]
    C: Annotated[Array, ("m", "n")]
    lower: Annotated[Array, ("n + m",)]
    upper: Annotated[Array, ("n + m",)]

    def __init__(self, n_variables: int, n_inequalities: int, n_equalities: int) -> None:
        n, m = n_variables, n_inequalities + n_equalities
        super().__init__({"n": n, "m": m, "n + m": n + m}, H=np.eye(n))
        self.lower[: n + n_inequalities] = -UNBOUNDED
        self.upper[: n + n_inequalities] = UNBOUNDED
        self.n, self.n_equalities = n, n_equalities


class QPStatus(StrEnum):
    """What the solver claims and what the check outside of it found."""

    IDLE = "idle"
    """No QP was posed."""
    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    SOLVER_ERROR = "solver error"
    REJECTED = "rejected"
    """The solver claims success but the residuals exceed the tolerances."""


class QPSolution(NamedTuple):
    """Primal and dual point that a solver returned.

    Attributes:
        x: (n,) primal variables.
        multipliers: (n + m,) of the bounds and rows; positive at an upper bound.
        status: The solver's claim.
        iterations: Solver iterations.
    """

    x: Array
    multipliers: Array
    status: QPStatus
    iterations: int


class QPResiduals(NamedTuple):
    """How far a point is from optimal, computed without the solver.

    Attributes:
        primal: Largest violation of a bound or row (the row's unit).
        dual: Largest entry of H x + g + multipliers^T (I, C), relative to that of g.
        gap: Duality gap, relative to the cost.
    """

    primal: float
    dual: float
    gap: float


class QPTolerances(NamedTuple):
    """A solution with larger residuals is not applied."""

    primal: float
    dual: float
    gap: float

    def accept(self, residuals: QPResiduals) -> bool:
        """Whether all residuals are within the tolerances; NaN is not."""
        return (
            residuals.primal <= self.primal
            and residuals.dual <= self.dual
            and residuals.gap <= self.gap
        )


class QPReport(NamedTuple):
    """How the QP of a control tick went.

    Attributes:
        status: Status after the check of the residuals.
        residuals: Residuals computed outside the solver.
        iterations: Solver iterations.
    """

    status: QPStatus
    residuals: QPResiduals
    iterations: int

    @property
    def failed(self) -> bool:
        """Whether the solution was not applied."""
        return self.status not in (QPStatus.SOLVED, QPStatus.IDLE)

    def as_dict(self) -> dict[str, str | float]:
        """The entries of an environment's ``info``."""
        return {
            "solver_status": str(self.status),
            "solver_primal_residual": self.residuals.primal,
            "solver_dual_residual": self.residuals.dual,
            "solver_gap": self.residuals.gap,
        }


def worse(first: QPReport, second: QPReport) -> QPReport:
    """The report that tells of a failure, else the one with the larger residuals."""
    return max(second, first, key=lambda report: (report.failed, max(report.residuals)))


IDLE = QPReport(QPStatus.IDLE, QPResiduals(0.0, 0.0, 0.0), 0)
"""Report before the first tick."""
