"""The phases of a jump (paper section II-D) as one state machine."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import PhaseConfig
from icub_jump_env.control.qp.problem import QPReport
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import JumpPlan

Array = NDArray[np.float64]


class Phase(IntEnum):
    """Launching, aerial and landing phase."""

    LAUNCH = 0
    FLIGHT = 1
    LANDING = 2


class Tick(NamedTuple):
    """Outcome of one control tick.

    Attributes:
        command: Command to the joint servos.
        report: How the QP went; ``None`` in phases without one.
    """

    command: JointCommand
    report: QPReport | None


class PhaseController(Protocol):
    """Decides the joints in one phase. Times are those since the start of the jump (s)."""

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """The phase begins."""
        ...

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick.

        Args:
            state: The believed state.
            time: Time since the start of the jump (s).
            residual_target: (5,) target offset of the residual (m; kg m^2/s).
        """
        ...


class PhaseMachine:
    """Launch until T or lift-off, whichever is first; flight until the first contact.

    Or until lift-off alone, if so configured. Phases only move forward. When the launch
    ends by time the feet still carry load, so that flight can end only after a lift-off
    was seen.

    Attributes:
        phase: The current phase.
        airborne: Whether a lift-off has been detected.
    """

    def __init__(self, config: PhaseConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Back to the launching phase."""
        self.phase = Phase.LAUNCH
        self.airborne = False
        self._unloaded_ticks = 0

    def update(self, time: float, duration: float, normal_force: float) -> Phase:
        """One control tick.

        Args:
            time: Time since the start of the launch (s).
            duration: Take-off time T of the plan (s).
            normal_force: Total measured normal force under the feet (N).

        Returns:
            The phase from now on.
        """
        config = self._config
        if not self.airborne:
            # After T no launch is cut short any more, and sensors may have an offset.
            launching = self.phase is Phase.LAUNCH
            unloaded = normal_force < (config.lift_off if launching else config.touch_down)
            self._unloaded_ticks = self._unloaded_ticks + 1 if unloaded else 0
            self.airborne = self._unloaded_ticks >= config.lift_off_ticks
        over = self.airborne or (config.launch_end == "time" and time >= duration)
        if self.phase is Phase.LAUNCH and over:
            self.phase = Phase.FLIGHT
        elif self.phase is Phase.FLIGHT and self.airborne and normal_force > config.touch_down:
            self.phase = Phase.LANDING
        return self.phase
