"""The iCub URDF as both engines read it: one description, prepared once.

The URDF of icub-models needs three changes before MuJoCo and Pinocchio agree on it:
joints that the jump does not use are welded, limits that are placeholders are
replaced, and simulator-specific blocks and sensor frames are dropped.
"""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET
from pathlib import Path

import icub_models

from icub_jump_env.robot import icub

DEFAULT_MODEL = "iCubGenova04"
"""The paper's robot, an iCub v2.5."""


def model_names() -> list[str]:
    """The iCubs of icub-models that can be simulated, all with the joints of the jump.

    The package holds single hands and wrists, too.
    """
    iCubs = {name for name in icub_models.get_robot_names() if name.startswith("iCub")}
    return sorted(iCubs.difference(icub.UNPHYSICAL_MODELS))


def model_path(name: str = DEFAULT_MODEL) -> Path:
    """Path of the URDF file inside the installed icub-models package."""
    return Path(icub_models.get_model_file(name))


def mesh_root(name: str = DEFAULT_MODEL) -> Path:
    """Folder that ``package://iCub/`` stands for in the URDF."""
    return model_path(name).parents[2]


@functools.cache
def load_urdf(name: str = DEFAULT_MODEL, ankle_shift: bool = True, visuals: bool = False) -> str:
    """The prepared URDF.

    Args:
        name: Model of the icub-models package.
        ankle_shift: Move an ankle pitch range that begins above -50 deg by -15 deg, as
            the paper did.
        visuals: Keep the visual meshes, with paths relative to :func:`mesh_root`.

    Returns:
        URDF text with 23 revolute joints in the order of ``icub.JOINT_NAMES``.
    """
    robot = ET.parse(model_path(name)).getroot()
    for block in robot.findall("gazebo"):
        robot.remove(block)

    # Links without mass are sensor frames; only the soles' matter here.
    kept = {
        link.attrib["name"]
        for link in robot.findall("link")
        if link.find("inertial") is not None or link.attrib["name"] in icub.SOLE_FRAMES
    }
    for link in robot.findall("link"):
        if link.attrib["name"] not in kept:
            robot.remove(link)
            continue
        # The collision meshes are the visual ones; icub.py has boxes instead.
        for collision in link.findall("collision"):
            link.remove(collision)
        for visual in link.findall("visual"):
            if not visuals:
                link.remove(visual)
                continue
            for mesh in visual.iter("mesh"):
                mesh.set("filename", mesh.attrib["filename"].removeprefix("package://iCub/"))

    for joint in robot.findall("joint"):
        if _child(joint) not in kept:
            robot.remove(joint)
        elif joint.attrib["name"] in icub.JOINT_NAMES:
            _set_limits(joint, ankle_shift)
        else:
            joint.set("type", "fixed")

    # Pinocchio visits children in alphabetical order, MuJoCo in the order of the file.
    joints = sorted(robot.findall("joint"), key=_child)
    for joint in joints:
        robot.remove(joint)
    robot.extend(joints)
    return ET.tostring(robot, encoding="unicode")


def _child(joint: ET.Element) -> str:
    child = joint.find("child")
    assert child is not None
    return child.attrib["link"]


def _set_limits(joint: ET.Element, ankle_shift: bool) -> None:
    name = joint.attrib["name"]
    limit = joint.find("limit")
    assert limit is not None
    for attribute, assumed in zip(("effort", "velocity"), icub.assumed_limits(name), strict=True):
        if float(limit.attrib[attribute]) == icub.URDF_PLACEHOLDER:
            limit.set(attribute, repr(assumed))
    shifted = float(limit.attrib["lower"]) < icub.SHIFTED_ANKLE + 1e-6
    if ankle_shift and name in icub.ANKLE_PITCH_JOINTS and not shifted:
        for bound in ("lower", "upper"):
            limit.set(bound, repr(float(limit.attrib[bound]) - icub.ANKLE_SHIFT))
