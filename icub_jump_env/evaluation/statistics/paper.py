"""What the paper reports of its controllers (section IV)."""

from __future__ import annotations

from dataclasses import dataclass

from icub_jump_env.config import ControllerName


@dataclass(frozen=True)
class PaperResult:
    """Numbers of the nominal jump, 4 cm at a displacement of 11 cm; SI units.

    Attributes:
        flight_height: CoM rise in flight (simulation, section IV-A).
        sole_height: Largest height of the soles (simulation, section IV-A).
        takeoff_velocity: Commanded take-off velocity (section IV).
        takeoff_time: Take-off time (section IV, Fig. 2).
        ballistic_height: CoM rise computed from the take-off speed measured on the
            real robot (section IV-B), which jumped with the velocity controller only.
    """

    flight_height: float
    sole_height: float
    ballistic_height: float | None
    takeoff_velocity: float = 0.89
    takeoff_time: float = 0.43
    landed: float = 1.0


PAPER: dict[ControllerName, PaperResult] = {
    "velocity": PaperResult(0.035, 0.037, ballistic_height=0.03),
    "torque": PaperResult(0.016, 0.023, ballistic_height=None),
}
