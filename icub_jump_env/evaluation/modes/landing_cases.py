"""What the landing study compares, and what disturbs the jump in it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.modes.cases import Case
from icub_jump_env.evaluation.quantities import CM
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.simulation.randomization import RANDOMIZATIONS

HOLD, FEEDBACK = "hold", "feedback"

VARIANTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        HOLD: {"estimator": "feet_fixed", "flight": "minimum_jerk", "landing": "hold"},
        "flight feedback": {"estimator": "imu", "flight": "feedback", "landing": "hold"},
        "landing feedback": {"estimator": "imu", "flight": "minimum_jerk", "landing": "feedback"},
        FEEDBACK: {"estimator": "imu", "flight": "feedback", "landing": "feedback"},
    }
)
"""What is compared, as fields of the configuration; the first one is the paper's."""

FLIGHT_TIME = 0.19
"""Flight time of the paper's jump of 4 cm (s); a spin is told as the angle it turns meanwhile."""

HIGHEST: Mapping[ControllerName, float] = MappingProxyType({"velocity": 0.078, "torque": 0.0725})
"""Command of the highest whole-body plan that lands in nearly all worlds of ``full`` (m)."""

LEFT = math.pi / 2
"""Direction of a push to the left (rad)."""


@dataclass(frozen=True)
class Disturbance:
    """Something that disturbs a jump of 4 cm in the worlds ``full``.

    Attributes:
        name: What it is.
        unit: Unit of the sizes.
        positive: What a positive size means.
        sizes: Its sizes, without zero.
        ranges: Values of the ``Randomization`` that make a size.
    """

    name: str
    unit: str
    positive: str
    sizes: tuple[float, ...]
    ranges: Callable[[float], dict[str, float]]

    @property
    def signed(self) -> bool:
        """Whether it comes in both directions."""
        return min(self.sizes) < 0.0

    @property
    def scale(self) -> str:
        """Unit and positive direction, for headings and axes."""
        if not self.positive:
            return self.unit
        return f"{self.unit}, {'+ ' if self.signed else ''}{self.positive}"


@dataclass(frozen=True)
class LandingCase(Case):
    """One kind of jump in the landing study.

    Attributes:
        size: Size of the disturbance that it belongs to; None without any.
    """

    size: float | None = None


def disturbances(mass: float) -> list[Disturbance]:
    """What disturbs the jump.

    Args:
        mass: Nominal mass of the robot (kg); a push of 1 m/s has the impulse that gives this
            mass so much speed.
    """
    return [
        Disturbance(
            "rotation at lift-off", f"deg in {FLIGHT_TIME:g} s", "forward", (-10, -8, -5, 5, 7),
            lambda deg: {"takeoff_spin": math.radians(deg) / FLIGHT_TIME},
        ),
        Disturbance(
            "floor tilt fore-aft", "deg", "uphill ahead", (-5, -4, -2, 2, 4, 5),
            lambda deg: {"floor_tilt": math.radians(deg)},
        ),
        Disturbance(
            "floor tilt sideways", "deg", "uphill to the left", (2, 4, 6),
            lambda deg: {"floor_tilt_lateral": math.radians(deg)},
        ),
        Disturbance(
            "step under the left foot", "cm", "", (1, 2), lambda cm: {"step": cm / CM}
        ),
        Disturbance(
            "edge under the left foot", "cm", "front", (-2, -1, 1, 2),
            lambda cm: {"edge": cm / CM},
        ),
        Disturbance(
            "push in flight", "m/s", "forward", (-0.2, -0.1, 0.1, 0.2),
            lambda speed: {"flight_push": mass * speed},
        ),
        Disturbance(
            "push after landing", "m/s", "forward", (-0.35, -0.3, -0.2, 0.2, 0.25, 0.3),
            lambda speed: {"landing_push": mass * speed, "landing_push_time": 0.4},
        ),
        Disturbance(
            "side push after landing", "m/s", "to the left", (0.2, 0.4),
            lambda speed: {
                "landing_push": mass * speed,
                "landing_push_time": 0.4,
                "landing_push_direction": LEFT,
            },
        ),
        Disturbance(
            "lateral slope from launch on", "deg", "uphill to the left", (2, 4),
            lambda deg: {"lateral_slope": math.radians(deg)},
        ),
        Disturbance(
            "push in the launch", "N s", "forward", (-6, 6), lambda impulse: {"push": impulse}
        ),
    ]  # fmt: skip


def disturbances_of(config: JumpConfig) -> list[Disturbance]:
    """What disturbs the robot of a configuration."""
    return disturbances(FeetFixedKinematics(config.robot_value).mass)


def landing_cases(config: JumpConfig) -> list[LandingCase]:
    """The cases for the controller of a configuration; the first one is nowhere disturbed."""
    disturbed = [
        LandingCase(
            disturbance.name,
            f"{size:{'+' if disturbance.signed else ''}g}",
            {
                "jump_height": 0.04,
                "randomization": dataclasses.replace(
                    RANDOMIZATIONS["full"],
                    **{name: (v, v) for name, v in disturbance.ranges(size).items()},
                ),
            },
            size,
        )
        for disturbance in disturbances_of(config)
        for size in disturbance.sizes
    ]
    return [*_undisturbed(config.controller_name), *disturbed]


def _undisturbed(controller: ControllerName) -> list[LandingCase]:
    curve_8: dict[str, Any] = {"jump_height": 0.08, "com_displacement": 0.08}
    curve_6: dict[str, Any] = {"jump_height": 0.06, "com_displacement": 0.08}
    plan: dict[str, Any] = {"planner": "whole_body"}
    jumps: dict[str, dict[str, Any]] = {
        "4 cm, full": {"jump_height": 0.04, "randomization": "full"},
        "4 cm, hard": {"jump_height": 0.04, "randomization": "hard"},
        "8 cm after 8 cm, full": curve_8 | {"randomization": "full"},
        "6 cm after 8 cm, hard": curve_6 | {"randomization": "hard"},
        "5 cm, disturbed": {"jump_height": 0.05, "randomization": "disturbed"},
        "highest plan, full": plan | {"jump_height": HIGHEST[controller], "randomization": "full"},
        "6 cm plan, hard": plan | {"jump_height": 0.06, "randomization": "hard"},
        "8 cm after 8 cm, full, sensors": curve_8
        | {"randomization": "full", "sensors": "realistic"},
    }
    return [LandingCase("", label, changes) for label, changes in jumps.items()]
