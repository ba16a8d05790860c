"""What a plan keeps away from the limits, and how one is chosen among those that do."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

Range = tuple[float, float]

_deg = math.radians


@dataclass(frozen=True)
class LaunchMargins:
    """Limits and costs of a launch; ours, chosen on tuning seeds unless a source is named.

    Attributes:
        torque: Share of the torque limits; the rest is for the controller's feedback and for
            robots weaker than nominal.
        speed: Share of the speed limits.
        position: Distance to the position limits (rad).
        ankle: Range of the ankle pitch (rad).
        hip: Largest hip pitch (rad): pelvis and thighs touch beyond 80 deg.
        takeoff_hip: Largest hip pitch at take-off (rad).
        torso: Range of the torso pitch (rad).
        shoulder: Smallest shoulder pitch (rad).
        shoulder_roll: Where it stays (rad): forearms clear of the thighs.
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
    """

    torque: float = 0.85
    speed: float = 0.98
    position: float = _deg(3.0)
    ankle: Range = (_deg(-48.0), _deg(15.0))
    hip: float = _deg(78.0)
    takeoff_hip: float = _deg(78.0)
    torso: Range = (_deg(-17.0), _deg(20.0))
    shoulder: float = -1.1
    shoulder_roll: float = _deg(30.0)
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


@dataclass(frozen=True)
class Branch:
    """Plans of one kind, which can be interpolated.

    Attributes:
        lowest: Lowest height (m).
        highest: Highest height (m); if it can, the highest that can be reached.
        launch: Limits and costs.
        starts: Coordinates (rad) of a crouch and a take-off between which a search starts; the
            program has several local optima, of which the highest is taken.
    """

    lowest: float
    highest: float
    launch: LaunchMargins
    starts: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]


def _degrees(*angles: float) -> tuple[float, ...]:
    return tuple(map(_deg, angles))


_CROUCH = _degrees(-46.4, -111.7, 75.2, 20.0, -17.2, 45.8)
"""That of the paper's jump."""

BRANCHES = (
    Branch(
        0.015,
        0.06,
        LaunchMargins(),
        starts=((_CROUCH, _degrees(-40, -91, 69, -6, -63, 52)),),
    ),
    Branch(
        0.06,
        math.inf,
        LaunchMargins(takeoff_hip=_deg(40.0), torso=(_deg(-17.0), _deg(60.0)), shoulder=-1.25),
        starts=(
            (_CROUCH, _degrees(-40, -73, 11, 35, -63, 59)),
            (_CROUCH, _degrees(-40, -73, 11, 35, -80, 40)),
            (_degrees(-48, -112, 75, 40, -17, 46), _degrees(-17, -69, 52, 6, -35, 45)),
        ),
    ),
)
"""The family: up to 6 cm hips and knees stretch; beyond, the torso swings up from a deep bow and
the hips close again before take-off."""


@dataclass(frozen=True)
class FamilyMargins:
    """How a family is made.

    Attributes:
        branches: From low to high.
        landing: Of all of them.
        step: Distance of the heights (m).
    """

    branches: tuple[Branch, ...] = BRANCHES
    landing: LandingMargins = field(default_factory=LandingMargins)
    step: float = 0.005
