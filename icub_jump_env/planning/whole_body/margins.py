"""What a plan keeps away from the limits, and how one is chosen among those that do."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from icub_jump_env.checks import check_number, check_numbers, check_range, store

Range = tuple[float, float]

Bounds = Mapping[str, tuple[float, float, str]]
"""Smallest and largest value, and the unit, by field."""

_deg = math.radians


_SHARE = (0.05, 1.0, "of the limit")
_ANGLE = (-math.pi, math.pi, "rad")
_COST = (0.0, 1e6, "")

_LAUNCH_BOUNDS: Bounds = {
    **dict.fromkeys(("torque", "speed", "torso_speed"), _SHARE),
    **dict.fromkeys(("ankle", "hip", "takeoff_hip", "torso", "shoulder"), _ANGLE),
    **dict.fromkeys(("chest", "takeoff_chest"), _ANGLE),
    **dict.fromkeys(("torque_cost", "speed_cost", "jerk_cost", "crouch_cost"), _COST),
    "position": (0.0, 0.5, "rad"),
    "stop": (0.0, 0.5, "rad"),
    "friction": (0.01, 2.0, ""),
    "cop": (0.0, 0.07, "m"),
    "least_load": (0.0, 1.0, "of the weight"),
    "duration": (0.05, 2.0, "s"),
    "displacement": (0.0, 0.3, "m"),
    "crouch_com": (0.0, 0.07, "m"),
    "crouch_height": (0.1, 0.6, "m"),
    "forward_speed": (-1.0, 1.0, "m/s"),
    "momentum": (-10.0, 10.0, "kg m^2/s"),
}

_LANDING_BOUNDS: Bounds = {
    "retraction": (0.02, 1.0, "s"),
    "speed": _SHARE,
    "position": (0.0, 0.5, "rad"),
    **dict.fromkeys(("ankle", "hip", "torso", "shoulder", "elbow", "chest", "posture"), _ANGLE),
    "com_height": (0.1, 0.6, "m"),
    "com_range": (0.0, 0.3, "m"),
    "com_forward": (-0.07, 0.07, "m"),
    "level_cost": _COST,
    "posture_cost": _COST,
}


@dataclass(frozen=True)
class LaunchMargins:
    """Limits and costs of a launch; ours, chosen on tuning seeds unless a source is named.

    Attributes:
        torque: Share of the torque limits; the rest is for the controller's feedback and for
            robots weaker than nominal.
        speed: Share of the speed limits.
        torso_speed: That of the torso.
        position: Distance to the position limits (rad).
        stop: Distance to them (rad) where joints can stop after take-off, at full torque.
        ankle: Range of the ankle pitch (rad).
        hip: Largest hip pitch (rad): pelvis and thighs touch beyond 80 deg.
        takeoff_hip: Largest hip pitch at take-off (rad).
        torso: Range of the torso pitch (rad).
        shoulder: Smallest shoulder pitch (rad).
        friction: Of the floor; the controller counts on 0.5.
        cop: Distance of the CoP to heels and toes (m).
        least_load: Least vertical force, as a share of the weight; with less the feet are
            taken to have left the floor.
        duration: Range of T (s).
        displacement: Least CoM rise (m).
        crouch_com: Least distance of the CoM in the crouch to heels and toes (m).
        crouch_height: Least height of the CoM in the crouch (m).
        chest: Range of the chest's pitch (rad).
        takeoff_chest: Its largest value at take-off (rad).
        forward_speed: Speed of the CoM at take-off, forward (m/s): falls are backward.
        momentum: Range of the angular momentum about +y at take-off (kg m^2/s).
        torque_cost, speed_cost, jerk_cost: Weights of the mean squares.
        crouch_cost: Weight of the distance to the family's crouch (rad^-2), which makes the
            family smooth.

    Raises:
        ConfigError: If a value is out of range.
    """

    torque: float = 0.85
    speed: float = 0.98
    torso_speed: float = 0.98
    position: float = _deg(3.0)
    stop: float = 0.0
    ankle: Range = (_deg(-48.0), _deg(15.0))
    hip: float = _deg(78.0)
    takeoff_hip: float = _deg(78.0)
    torso: Range = (_deg(-17.0), _deg(20.0))
    shoulder: float = -1.1
    friction: float = 0.35
    cop: float = 0.02
    least_load: float = 0.3
    duration: Range = (0.2, 0.5)
    displacement: float = 0.07
    crouch_com: float = 0.03
    crouch_height: float = 0.36
    chest: Range = (-0.1, _deg(50.0))
    takeoff_chest: float = _deg(35.0)
    forward_speed: float = 0.1
    momentum: Range = (-0.1, 0.0)
    torque_cost: float = 1.0
    speed_cost: float = 0.3
    jerk_cost: float = 1e-4
    crouch_cost: float = 1.0

    def __post_init__(self) -> None:
        _check(self, _LAUNCH_BOUNDS)


@dataclass(frozen=True)
class LandingMargins:
    """Where the posture of flight and landing may be; ours, chosen on tuning seeds.

    Attributes:
        retraction: Duration of the motion to it (s).
        speed: Share of the speed limits that the motion may use.
        position: Distance to the position limits (rad).
        ankle: Smallest ankle pitch (rad).
        hip: Largest hip pitch (rad).
        torso: Range of the torso pitch (rad).
        shoulder: Smallest shoulder pitch (rad).
        elbow: Largest elbow angle (rad).
        com_height: Largest height of the CoM (m); at least 1 cm below that at take-off.
        com_range: How far it may be below (m).
        com_forward: CoM before the middle of the soles (m).
        chest: Range of the chest's pitch (rad).
        level_cost: Weight of the soles' pitch at touch-down (rad^-2).
        posture: Preferred coordinates (rad); those of the arms are halfway to the take-off's.
        posture_cost: Weights of the distance to them (rad^-2).

    Raises:
        ConfigError: If a value is out of range.
    """

    retraction: float = 0.14
    speed: float = 0.95
    position: float = _deg(4.0)
    ankle: float = _deg(-41.0)
    hip: float = _deg(78.0)
    torso: Range = (_deg(-15.0), _deg(60.0))
    shoulder: float = _deg(-84.0)
    elbow: float = _deg(80.0)
    com_height: float = 0.475
    com_range: float = 0.04
    com_forward: float = 0.0035
    chest: Range = (_deg(-2.0), _deg(28.0))
    level_cost: float = 100.0
    posture: tuple[float, ...] = tuple(map(_deg, (-34.0, -78.0, 56.0, 8.0, -17.0, 45.0)))
    posture_cost: tuple[float, ...] = (0.09, 0.09, 0.36, 1.0, 0.09, 0.09)

    def __post_init__(self) -> None:
        _check(self, _LANDING_BOUNDS)


def _check(margins: Any, bounds: Bounds) -> None:
    """Refuse what is out of bounds, and ranges that are none."""
    for field in dataclasses.fields(margins):
        name, value = field.name, getattr(margins, field.name)
        low, high, unit = bounds[name]
        if not isinstance(field.default, tuple):
            store(margins, **{name: check_number(name, value, low, high, unit)})
        elif len(field.default) == 2:
            store(margins, **{name: check_range(name, value, low, high, unit)})
        else:
            length = len(field.default)
            store(margins, **{name: check_numbers(name, value, length, low, high, unit)})


RETRACTION_SHARE = 0.9
"""Of the ballistic flight, in which the joints move to the paper's landing posture; ours."""


@dataclass(frozen=True)
class Branch:
    """Plans of one kind, which can be interpolated.

    Attributes:
        lowest: Lowest height (m).
        highest: Highest height (m); if it can, the highest that can be reached.
        launch: Limits and costs.
        starts: Coordinates (rad) of a crouch and a take-off between which a search starts; the
            program has several local optima, of which the highest is taken.
        landing: Where flight and landing may be; ``None``: the paper's landing posture, after
            :data:`RETRACTION_SHARE` of the flight.
        step: Distance of the heights (m).
    """

    lowest: float
    highest: float
    launch: LaunchMargins
    starts: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]
    landing: LandingMargins | None = None
    step: float = 0.005


def _degrees(*angles: float) -> tuple[float, ...]:
    return tuple(map(_deg, angles))


_CROUCH = _degrees(-46.4, -111.7, 75.2, 20.0, -17.2, 45.8)
"""That of the paper's jump."""

_STRETCH = Branch(
    0.015,
    0.06,
    LaunchMargins(),
    starts=((_CROUCH, _degrees(-40, -91, 69, -6, -63, 52)),),
    step=0.01,
)
"""Hips and knees stretch, as one would."""

_BOW = ((_degrees(-48, -112, 75, 40, -17, 46), _degrees(-17, -69, 52, 6, -35, 45)),)
"""Where searches for a swing start; from two other starts they found the same."""

_SWING = LaunchMargins(
    speed=1.0,
    torso_speed=1.0,
    position=_deg(1.0),
    ankle=(_deg(-49.0), _deg(18.0)),
    takeoff_hip=_deg(40.0),
    torso=(_deg(-17.0), _deg(60.0)),
    shoulder=-1.25,
    cop=0.01,
    momentum=(-0.2, 0.1),
)
"""The torso swings up from a deep bow and the hips close again before take-off. What weak robots
lack is the torque of knees and torso; the other limits need next to no margin."""

_TALL = LandingMargins(retraction=0.15, speed=0.9, shoulder=_deg(-72.0), com_height=0.485)
"""After a swing that weaker robots follow: feedback ends with a lean of 10 deg instead of 20."""

_UPRIGHT = LandingMargins(chest=(_deg(-2.0), _deg(23.0)))
"""After a swing: what is landed leans by less than 30 deg, and it rocks."""


@dataclass(frozen=True)
class FamilyMargins:
    """How a family is made.

    Attributes:
        branches: From low to high.
        shoulder_roll: Where it stays (rad): forearms clear of the thighs.
    """

    branches: tuple[Branch, ...]
    shoulder_roll: float = _deg(30.0)


_VELOCITY = FamilyMargins(
    (
        _STRETCH,
        # With more torque, or higher, weaker robots fall behind: they rise no higher on the mean.
        Branch(
            0.06,
            0.0755,
            dataclasses.replace(_SWING, torque=0.87, forward_speed=0.05, duration=(0.2, 0.7)),
            _BOW,
            _TALL,
        ),
        # With all of the torque the jump is 0.4 cm lower.
        Branch(
            0.0755,
            math.inf,
            dataclasses.replace(_SWING, torque=0.97, forward_speed=0.05, duration=(0.2, 0.6)),
            _BOW,
            _UPRIGHT,
            # Some of them fall with other robots; two must be left.
            step=0.0025,
        ),
    )
)

_TORQUE = FamilyMargins(
    (
        _STRETCH,
        # Weak motors overshoot: the torso its speed, ankles and arms their ends.
        Branch(
            0.06,
            0.073,
            dataclasses.replace(
                _SWING,
                torso_speed=0.95,
                stop=0.05,
                ankle=(_deg(-48.0), _deg(16.0)),
                forward_speed=0.115,
                momentum=(-0.1, 0.0),
                duration=(0.2, 0.6),
            ),
            _BOW,
            _TALL,
        ),
        Branch(
            0.073,
            math.inf,
            dataclasses.replace(_SWING, torque=1.0, momentum=(-0.1, 0.0)),
            _BOW,
            dataclasses.replace(_UPRIGHT, retraction=0.165, speed=0.85, shoulder=_deg(-70.0)),
        ),
    )
)

MARGINS = {"velocity": _VELOCITY, "torque": _TORQUE}
"""Of each controller's family. Up to 6 cm hips and knees stretch; beyond, the torso swings, with
margins for randomised robots as far as those follow."""
