"""What a term of a QP is: an equation, a cost on the unknowns, or a limit.

Each writes in place into the buffers of its QP, once per control tick.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint

Array = NDArray[np.float64]


class Task(Protocol):
    """An equation A x = b of the unknowns x: a constraint, or a cost on its residual.

    Attributes:
        size: Number of its rows.
        weight: Weight of the squared residual, where it is a cost.
        scale: Factor on the rows: 1 for a constraint, the root of the weight for a cost.
    """

    size: int
    weight: float
    scale: float

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write A, (size, n_variables), and b, (size,), both times ``scale``."""
        ...


class DiagonalTask(Protocol):
    """A cost 1/2 ||x - x*||^2 of the first k unknowns x with a diagonal weight.

    Attributes:
        diagonal: (k,) the weight.
    """

    diagonal: Array

    def subtract(self, state: RobotState, setpoint: Setpoint, gradient: Array) -> None:
        """Subtract the weighted x* from the gradient, (k,)."""
        ...


class LimitBuffers(NamedTuple):
    """Where a limit writes: bounds of the unknowns, and rows of its own with their bounds."""

    lower: Array
    upper: Array
    rows: Array
    rows_lower: Array
    rows_upper: Array


class Limit:
    """Inequalities: bounds of the unknowns, and rows.

    Attributes:
        size: Number of its rows.
    """

    size: int = 0

    def prepare(self, buffers: LimitBuffers) -> None:
        """Write what does not change; once."""

    def write(self, state: RobotState, buffers: LimitBuffers) -> None:
        """Write what changes; once per control tick."""
