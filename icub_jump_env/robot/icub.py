"""What is known of the iCubs beside their URDFs, each number with its source.

Link masses, inertias, kinematics, joint limits and viscous damping are read from the URDFs
of the icub-models package; ``tests/robot`` asserts these numbers on the compiled models.

Joint order, everywhere in this package: Pinocchio's order of the URDF, that is left leg,
right leg, torso, left arm, right arm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.81
"""Standard gravity of the paper and of the simulation (m/s^2)."""

UNPHYSICAL_MODELS = ("iCubGenova03", "iCubLisboa01", "iCubNancy01")
"""First-generation iCubs of icub-models 3.2: their URDFs have inertias of about 1e-18 kg m^2,
some with negative eigenvalues, or meshes and sole frames that no engine here can read."""

BASE_LINK = "root_link"
"""Base of the floating-base model. It faces its own -x, hence the yaw below."""

BASE_YAW = math.pi
"""Yaw (rad) of ``root_link`` when the robot faces world +x."""

CHEST_LINK = "chest"

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
_TORSO = ("torso_pitch", "torso_roll", "torso_yaw")

JOINT_NAMES: tuple[str, ...] = (
    *(f"l_{name}" for name in _LEG),
    *(f"r_{name}" for name in _LEG),
    *_TORSO,
    *(f"l_{name}" for name in _ARM),
    *(f"r_{name}" for name in _ARM),
)
"""The 23 joints of the jump (paper section IV); neck and wrists are locked at 0."""

LEFT_LEG = slice(0, 6)
RIGHT_LEG = slice(6, 12)
TORSO = slice(12, 15)
ARMS = slice(15, 23)


@dataclass(frozen=True)
class Transmission:
    """Inertia of motor and gear of one joint.

    Attributes:
        rotor_inertia: Inertia of the rotor about its axis (kg m^2).
        gear_inertia: Inertia of the harmonic drive on the motor side (kg m^2).
        ratio: Motor turns per joint turn.
    """

    rotor_inertia: float
    gear_inertia: float
    ratio: float

    @property
    def armature(self) -> float:
        """Inertia reflected to the joint side (kg m^2)."""
        return (self.rotor_inertia + self.gear_inertia) * self.ratio**2


# The public configuration of IIT's whole-body-controllers for the iCub (configRobot.m,
# "motors reflected inertia"): rotors of 0.0827e-4 kg m^2 (legs, torso pitch and roll) and
# 0.0585e-4 (torso yaw, arms), harmonic drives of 0.054e-4 and 0.021e-4; ratios 100, hip
# pitch 150, torso yaw 200.
_LEG_TRANSMISSION = Transmission(0.0827e-4, 0.054e-4, 100.0)
_HIP_PITCH_TRANSMISSION = Transmission(0.0827e-4, 0.054e-4, 150.0)
_TORSO_YAW_TRANSMISSION = Transmission(0.0585e-4, 0.021e-4, 200.0)
_ARM_TRANSMISSION = Transmission(0.0585e-4, 0.021e-4, 100.0)


def transmission(joint: str) -> Transmission:
    """Motor and gear of the joint called ``joint``."""
    if joint.endswith("hip_pitch"):
        return _HIP_PITCH_TRANSMISSION
    if joint == "torso_yaw":
        return _TORSO_YAW_TRANSMISSION
    if joint.endswith(_ARM):
        return _ARM_TRANSMISSION
    return _LEG_TRANSMISSION


URDF_PLACEHOLDER = 50000.0
"""Effort and velocity that the URDFs give where they know none: torso and arms."""


def assumed_limits(joint: str) -> tuple[float, float]:
    """Effort (Nm) and speed (rad/s) of a joint whose URDF has none.

    Our assumptions: the torso uses the legs' motor group, the arms a smaller one.
    """
    return (20.0 if joint.endswith(_ARM) else 37.0), 7.64


SPEED_TOLERANCE = 0.03
"""Share of the speed limit by which a joint may exceed it: the servos fade out over it."""

ANKLE_PITCH_JOINTS = ("l_ankle_pitch", "r_ankle_pitch")
ANKLE_SHIFT = math.radians(15.0)
"""The paper's modification (section IV): the ankle pitch range moved by -15 deg."""
SHIFTED_ANKLE = math.radians(-50.0)
"""Where the shifted range begins. ``iCubGenova02`` has it in its URDF."""


@dataclass(frozen=True)
class Sole:
    """Contact rectangle of a foot, in its sole frame (x forward, y left, z up).

    Source: collision box of the iCub V2_5 Gazebo model.
    """

    x_min: float = -0.0535
    x_max: float = 0.1065
    half_width: float = 0.036
    bottom: float = -0.0105

    @property
    def half_length(self) -> float:
        """Half of the sole's length (m)."""
        return (self.x_max - self.x_min) / 2

    @property
    def center_x(self) -> float:
        """Middle of the sole along x (m)."""
        return (self.x_max + self.x_min) / 2


_SOLE_2_5_PLUS = Sole(x_min=-0.0588, x_max=0.1012, bottom=0.0)
"""The same foot with its sole frame on the underside; from the URDF of the KIT_007 model."""
SOLES: Mapping[str, Sole] = MappingProxyType(
    {"iCubGenova02": _SOLE_2_5_PLUS, "iCubGazeboV2_5_KIT_007": _SOLE_2_5_PLUS}
)
"""Soles of the models whose sole is not ``Sole()``."""
SOLE_FRAMES = ("l_sole", "r_sole")
FEET_FRICTION = 0.8
"""Coulomb friction between soles (rubber) and floor; our assumption."""

# Boxes that keep the rest of a fallen robot on the floor: centre and half size (m) in
# the link frame, the axis-aligned bounds of the link's visual mesh (iCubGenova04).
BODY_BOXES: Mapping[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = (
    MappingProxyType(
        {
            "root_link": ((0.031, 0.0, -0.062), (0.073, 0.111, 0.094)),
            "chest": ((0.0, 0.076, -0.060), (0.121, 0.116, 0.139)),
            "head": ((-0.008, 0.118, -0.017), (0.085, 0.092, 0.105)),
            "l_upper_leg": ((0.004, 0.002, -0.057), (0.059, 0.057, 0.120)),
            "r_upper_leg": ((0.004, -0.002, -0.057), (0.059, 0.057, 0.120)),
            "l_lower_leg": ((0.007, 0.002, -0.098), (0.058, 0.054, 0.126)),
            "r_lower_leg": ((0.007, -0.002, -0.098), (0.058, 0.054, 0.126)),
            "l_upper_arm": ((-0.014, 0.0, 0.030), (0.050, 0.040, 0.065)),
            "r_upper_arm": ((-0.014, 0.0, 0.030), (0.050, 0.040, 0.065)),
            "l_forearm": ((0.042, -0.002, 0.003), (0.073, 0.037, 0.055)),
            "r_forearm": ((-0.042, 0.0, 0.003), (0.073, 0.037, 0.054)),
            "l_hand": ((0.069, 0.008, 0.044), (0.079, 0.026, 0.067)),
            "r_hand": ((-0.069, 0.008, 0.043), (0.079, 0.025, 0.066)),
        }
    )
)


def posture(**degrees: float) -> NDArray[np.float64]:
    """A left-right symmetric posture from joint angles in degrees.

    Args:
        degrees: Angle (deg) by joint name, without the ``l_``/``r_`` prefix for arms
            and legs. Joints left out are at 0.

    Returns:
        (23,) joint positions (rad), read-only.

    Raises:
        KeyError: If a name is no joint of the robot.
    """
    s = np.zeros(len(JOINT_NAMES))
    for name, angle in degrees.items():
        indices = [
            i for i, joint in enumerate(JOINT_NAMES) if joint in (name, f"l_{name}", f"r_{name}")
        ]
        if not indices:
            raise KeyError(name)
        s[indices] = math.radians(angle)
    s.setflags(write=False)
    return s


CROUCH = posture(
    hip_pitch=75.2,
    knee=-111.7,
    ankle_pitch=-46.4,
    torso_pitch=20.0,
    shoulder_pitch=-17.2,
    shoulder_roll=14.3,
    elbow=45.8,
)
"""Posture the jump starts from: CoM at 0.39 m, 2 cm before the middle of the ankles."""

UNSHIFTED_CROUCH = posture(
    hip_pitch=68.0,
    knee=-92.0,
    ankle_pitch=-34.0,
    torso_pitch=20.0,
    shoulder_pitch=-17.2,
    shoulder_roll=14.3,
    elbow=45.8,
)
"""The same where the ankles do not bend that far: CoM at 0.43 m, so less room to accelerate."""

LANDING = posture(
    hip_pitch=56.4,
    knee=-76.0,
    ankle_pitch=-34.5,
    torso_pitch=5.0,
    shoulder_pitch=-17.2,
    shoulder_roll=14.3,
    elbow=45.8,
)
"""Posture of flight and landing: feet retracted, stable at touch-down (section III-C). The
CoM is over the middle of the soles, as far from the heels as from the toes."""
