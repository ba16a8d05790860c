"""The launching phase: one of the paper's QPs tracks the plan."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.phases import Tick
from icub_jump_env.control.qp.problem import QPReport
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.reference import Reference
from icub_jump_env.robot.statics import Stance

Array = NDArray[np.float64]


class TrackingController(Protocol):
    """Decides the joints such that they track a set point: eq. 3 or eq. 6.

    Attributes:
        report: How the latest tick's QP went.
    """

    report: QPReport

    def reset(self, stance: Stance) -> None:
        """Forget everything about earlier ticks; the robot stands at rest."""
        ...

    def command(self, state: RobotState, setpoint: Setpoint) -> JointCommand:
        """One control tick: the command until the next one."""
        ...


class Launch:
    """Follows the plan, moved by the residual, from where the robot stands."""

    def __init__(self, controller: TrackingController, reference: Reference, dt: float) -> None:
        """Set up the phase.

        Args:
            controller: What tracks the set point.
            reference: What makes the set point.
            dt: Control period (s).
        """
        self._controller, self._reference, self._dt = controller, reference, dt

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``."""
        self._reference.start(plan, state.com)
        self._controller.reset(plan.stance)

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        reference = self._reference
        reference.update(time)
        reference.residual.step(residual_target, self._dt)
        command = self._controller.command(state, reference.setpoint)
        return Tick(command, self._controller.report)
