"""Landing: the posture is held (paper section III: position control)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.flight import MinimumJerkFlight
from icub_jump_env.control.phases import Tick
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import JumpPlan

Array = NDArray[np.float64]


class HoldLanding:
    """The motion of the flight goes on to its end, where it stays.

    An early touch-down does not stop the motion, so that chatter cannot either.
    """

    def __init__(self, flight: MinimumJerkFlight) -> None:
        self._flight = flight

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Nothing begins with the touch-down."""

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        return self._flight.tick(state, time, residual_target)
