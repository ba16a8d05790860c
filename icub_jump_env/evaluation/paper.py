"""What the paper reports of its velocity controller (section IV)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperResult:
    """Numbers of the nominal jump, 4 cm at a displacement of 11 cm; SI units.

    Attributes:
        flight_height: CoM rise in flight (simulation, section IV-A).
        sole_height: Largest height of the soles (simulation, section IV-A).
        takeoff_velocity: Commanded take-off velocity (section IV).
        takeoff_time: Take-off time (section IV, Fig. 2).
        ballistic_height: CoM rise computed from the take-off speed measured on the
            real robot (section IV-B).
    """

    flight_height: float = 0.035
    sole_height: float = 0.037
    takeoff_velocity: float = 0.89
    takeoff_time: float = 0.43
    ballistic_height: float = 0.03


PAPER = PaperResult()
