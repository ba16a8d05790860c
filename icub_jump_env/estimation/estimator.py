"""What an estimator is."""

from __future__ import annotations

from typing import Protocol

from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState


class Estimator(Protocol):
    """From readings to the believed state, and to a model that is up to date for it."""

    def estimate(self, readings: Readings) -> RobotState:
        """Take in the readings of one control tick; the next call overwrites the state."""
        ...
