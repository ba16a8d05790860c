"""What an estimator is."""

from __future__ import annotations

from typing import Literal, Protocol

from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState

EstimatorName = Literal["feet_fixed", "imu"]


class Estimator(Protocol):
    """From readings to the believed state, and to a model that is up to date for it."""

    def reset(self) -> None:
        """A jump begins: the robot stands at rest on both feet, which anchor the world frame."""
        ...

    def refresh(self, readings: Readings) -> RobotState:
        """In a copy: the state of the latest readings again; no time passes."""
        ...

    def estimate(self, readings: Readings) -> RobotState:
        """Take in the readings of one control tick; the next call overwrites the state."""
        ...
