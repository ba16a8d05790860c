"""The robot as a value: what every other part needs to know of the iCub it works with."""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import ConfigError
from icub_jump_env.robot import icub
from icub_jump_env.robot.icub import Sole
from icub_jump_env.robot.urdf import DEFAULT_MODEL, load_urdf, model_names

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Robot:
    """One iCub; made by :func:`load_robot`. All arrays are read-only, in joint order.

    Attributes:
        name: Model of the icub-models package.
        ankle_shift: Whether the ankle pitch range is the paper's.
        joint_names: The joints of the jump; n is their number.
        lower_position: (n,) rad.
        upper_position: (n,) rad.
        velocity_limit: (n,) rad/s.
        effort_limit: (n,) Nm.
        armature: (n,) rotor inertia reflected to the joint side (kg m^2).
        crouch: (n,) posture that the jump starts from (rad).
        landing: (n,) posture of flight and landing (rad).
        sole: Contact rectangle of a foot.
        sole_frames: Frames of the left and the right sole.
        base_link: Link of the floating base.
        chest_link: Link of the chest.
        body_boxes: Contact boxes of the other links: centre and half size (m).
        left_leg, right_leg, torso, arms: The joint groups, as slices of the joint order.
    """

    name: str
    ankle_shift: bool
    lower_position: Array
    upper_position: Array
    velocity_limit: Array
    effort_limit: Array
    armature: Array
    crouch: Array
    landing: Array
    sole: Sole
    joint_names: tuple[str, ...]
    sole_frames: tuple[str, str]
    base_link: str
    chest_link: str
    body_boxes: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]
    left_leg: slice
    right_leg: slice
    torso: slice
    arms: slice

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def leg_pitch_joints(self) -> list[int]:
        """Indices of hip pitch, knee and ankle pitch, left leg first."""
        stems = ("hip_pitch", "knee", "ankle_pitch")
        return [self.joint_names.index(f"{side}_{stem}") for side in "lr" for stem in stems]

    def per_joint(self, field: str, weights: Sequence[float]) -> Array:
        """Weights of all joints.

        Args:
            field: Name of the weights, for the error.
            weights: One of each joint, or three: of legs, torso and arms.

        Returns:
            (n,) weights in joint order.

        Raises:
            ConfigError: If there are more or fewer.
        """
        if len(weights) == self.n_joints:
            return np.array(weights, dtype=np.float64)
        if len(weights) != 3:
            allowed = f"3 weights (legs, torso, arms) or {self.n_joints}, one per joint"
            raise ConfigError(field, weights, allowed)
        values = np.empty(self.n_joints)
        legs, torso, arms = weights
        for group, weight in (
            (self.left_leg, legs),
            (self.right_leg, legs),
            (self.torso, torso),
            (self.arms, arms),
        ):
            values[group] = weight
        return values

    def urdf(self, visuals: bool = False) -> str:
        """The URDF that both engines read."""
        return load_urdf(self.name, self.ankle_shift, visuals)

    def __reduce__(self) -> tuple[object, tuple[str, bool]]:
        return load_robot, (self.name, self.ankle_shift)


def load_robot(name: str = DEFAULT_MODEL, ankle_shift: bool = True) -> Robot:
    """The iCub called ``name``, always the same object.

    Limits are those of its URDF; where that has a placeholder, the assumptions of
    :func:`icub_jump_env.robot.icub.assumed_limits`.

    Args:
        name: Model of the icub-models package.
        ankle_shift: Whether the ankle pitch range begins at -50 deg, as the paper moved
            it; a range that does so already stays as it is.

    Raises:
        ConfigError: If there is no such iCub with the joints of the jump.
    """
    if name not in model_names():
        allowed = f"one of {', '.join(model_names())}"
        if name in icub.UNPHYSICAL_MODELS:
            allowed += "; the URDF of this first-generation robot has unphysical inertias"
        raise ConfigError("robot", name, allowed)
    return _load(name, ankle_shift)


@functools.cache
def _load(name: str, ankle_shift: bool) -> Robot:
    joints = {
        joint.attrib["name"]: joint.find("limit")
        for joint in ET.fromstring(load_urdf(name, ankle_shift)).findall("joint")
    }

    def limits(attribute: str) -> Array:
        values = []
        for joint in icub.JOINT_NAMES:
            limit = joints[joint]
            assert limit is not None  # load_urdf wrote it
            values.append(float(limit.attrib[attribute]))
        return _frozen(values)

    lower = limits("lower")
    return Robot(
        name=name,
        ankle_shift=ankle_shift,
        lower_position=lower,
        upper_position=limits("upper"),
        velocity_limit=limits("velocity"),
        effort_limit=limits("effort"),
        armature=_frozen([icub.transmission(joint).armature for joint in icub.JOINT_NAMES]),
        crouch=icub.CROUCH if (lower < icub.CROUCH).all() else icub.UNSHIFTED_CROUCH,
        landing=icub.LANDING,
        sole=icub.SOLES.get(name, Sole()),
        joint_names=icub.JOINT_NAMES,
        sole_frames=icub.SOLE_FRAMES,
        base_link=icub.BASE_LINK,
        chest_link=icub.CHEST_LINK,
        body_boxes=icub.BODY_BOXES,
        left_leg=icub.LEFT_LEG,
        right_leg=icub.RIGHT_LEG,
        torso=icub.TORSO,
        arms=icub.ARMS,
    )


def _frozen(values: Sequence[float]) -> Array:
    array = np.array(values)
    array.setflags(write=False)
    return array
