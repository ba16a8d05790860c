"""The iCub on a floor as a MuJoCo model."""

from __future__ import annotations

import itertools
import math
from typing import Any
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot.collision import CAPSULES, LINK_PAIRS
from icub_jump_env.robot.icub import BASE_YAW, FEET_FRICTION
from icub_jump_env.robot.robot import Robot
from icub_jump_env.robot.urdf import mesh_root

FLOOR_GEOM = "floor"
BLOCK_GEOMS = STEP_GEOM, EDGE_GEOM = ("step", "edge")
BLOCK_HALF_SIZE = (0.5, 0.25, 0.1)
"""Of each block that may come to lie on the floor (m); most of its height is below the floor, so
that nothing comes near its underside."""
CAMERA = "side"
"""The default one."""
COLLISION_GROUP = 3
VISUAL_GROUP = 2

_CAMERAS = {
    CAMERA: ((1.15, -1.55, 0.72), (0.05, 0.0, 0.47)),
    "front": ((1.95, 0.0, 0.60), (0.0, 0.0, 0.47)),
    "profile": ((0.0, -1.95, 0.60), (0.0, 0.0, 0.47)),
}
"""Position and target (m) by name."""

_FLOOR_COLORS = ((0.86, 0.87, 0.89), (0.78, 0.80, 0.83))
_BOX_COLOR = (0.45, 0.55, 0.7, 1.0)
_BLOCK_COLOR = (0.70, 0.62, 0.50, 1.0)


def sole_geom(side: str) -> str:
    """Name of the sole's contact box, ``side`` being ``"l"`` or ``"r"``."""
    return f"{side}_sole_contact"


def build_model(
    robot: Robot,
    timestep: float,
    visuals: bool = False,
    self_collision: bool = False,
    blocks: bool = False,
) -> mujoco.MjModel:
    """Compile the iCub with a free base, one motor per joint, on a flat floor.

    Links keep their URDF names; body 1 is the base with the free joint. Each joint
    ``name`` has a torque motor of the same name, so ``data.ctrl`` is the vector of
    joint torques (Nm) in joint order, clamped at the effort limits.

    Args:
        robot: The robot.
        timestep: Physics step (s).
        visuals: Load the iCub's meshes. They have no effect on the dynamics.
        self_collision: Let the links touch each other.
        blocks: Add two blocks, for now deep below the floor.

    Returns:
        The compiled model.
    """
    # Without these settings MuJoCo merges welded links and drops visual meshes and their folders.
    compiler = (
        '<mujoco><compiler fusestatic="false" discardvisual="false" strippath="false" '
        f"meshdir={quoteattr(str(mesh_root(robot.name)))}/></mujoco>"
    )
    urdf = robot.urdf(visuals).replace("</robot>", f"{compiler}</robot>")
    spec = mujoco.MjSpec.from_string(urdf)
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE

    for geom in spec.geoms:
        geom.contype = 0
        geom.conaffinity = 0
        geom.group = VISUAL_GROUP
    spec.body(robot.base_link).add_freejoint(name="base")
    _add_contact_geometry(spec, robot)
    if blocks:
        _add_blocks(spec)
    if self_collision:
        _add_self_collision(spec)
    _add_motors(spec, robot)
    _add_sensors(spec, robot)
    _add_scenery(spec)
    return spec.compile()


def _add_contact_geometry(spec: mujoco.MjSpec, robot: Robot) -> None:
    # These collide with the floor only, not with each other.
    spec.worldbody.add_geom(
        name=FLOOR_GEOM,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 0.5],
        contype=1,
        conaffinity=0,
        friction=[FEET_FRICTION, 0.005, 0.0001],
        material="floor",
    )
    sole = robot.sole
    half_thickness = 0.004
    for side, frame in zip("lr", robot.sole_frames, strict=True):
        spec.body(frame).add_geom(
            name=sole_geom(side),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[sole.center_x, 0.0, sole.bottom + half_thickness],
            size=[sole.half_length, sole.half_width, half_thickness],
            contype=0,
            conaffinity=1,
            mass=0.0,
            friction=[FEET_FRICTION, 0.005, 0.0001],
            group=COLLISION_GROUP,
            rgba=_BOX_COLOR,
        )
    for link, (center, half_size) in robot.body_boxes.items():
        spec.body(link).add_geom(
            name=f"{link}_contact",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=center,
            size=half_size,
            contype=0,
            conaffinity=1,
            mass=0.0,
            group=COLLISION_GROUP,
            rgba=_BOX_COLOR,
        )


def _add_blocks(spec: mujoco.MjSpec) -> None:
    for name in BLOCK_GEOMS:
        spec.worldbody.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[0.0, 0.0, -2.0],
            size=BLOCK_HALF_SIZE,
            contype=1,
            conaffinity=0,
            friction=[FEET_FRICTION, 0.005, 0.0001],
            rgba=_BLOCK_COLOR,
        )


def _add_self_collision(spec: mujoco.MjSpec) -> None:
    for link, capsules in CAPSULES.items():
        for k, (start, end, radius) in enumerate(capsules):
            spec.body(link).add_geom(
                name=f"{link}_capsule_{k}",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[*start, *end],
                size=[radius, 0.0, 0.0],
                contype=0,
                conaffinity=0,
                mass=0.0,
                group=COLLISION_GROUP,
                rgba=_BOX_COLOR,
            )
    for links in LINK_PAIRS:
        for indices in itertools.product(*(range(len(CAPSULES[link])) for link in links)):
            first, second = (f"{link}_capsule_{k}" for link, k in zip(links, indices, strict=True))
            # Covers are smooth: no friction.
            spec.add_pair(name=f"{first} {second}", geomname1=first, geomname2=second, condim=1)


def _add_motors(spec: mujoco.MjSpec, robot: Robot) -> None:
    for name, armature, effort in zip(
        robot.joint_names, robot.armature, robot.effort_limit, strict=True
    ):
        spec.joint(name).armature = armature
        actuator = spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=name,
            ctrllimited=True,
            ctrlrange=[-effort, effort],
            forcelimited=True,
            forcerange=[-effort, effort],
        )
        actuator.set_to_motor()


def _add_sensors(spec: mujoco.MjSpec, robot: Robot) -> None:
    body = mujoco.mjtObj.mjOBJ_BODY
    sensor = mujoco.mjtSensor
    for name, kind in (
        ("com", sensor.mjSENS_SUBTREECOM),
        ("com_velocity", sensor.mjSENS_SUBTREELINVEL),
        ("angular_momentum", sensor.mjSENS_SUBTREEANGMOM),
    ):
        spec.add_sensor(name=name, type=kind, objtype=body, objname=robot.base_link)
    for quantity, kind in (
        ("position", sensor.mjSENS_JOINTPOS),
        ("velocity", sensor.mjSENS_JOINTVEL),
    ):
        for joint in robot.joint_names:
            spec.add_sensor(
                name=f"{joint}_{quantity}",
                type=kind,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=joint,
            )
    # The base faces its own -x; the IMU frame is turned to face forward.
    half_yaw = BASE_YAW / 2
    spec.body(robot.base_link).add_site(
        name="imu", quat=[math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)]
    )
    spec.add_sensor(
        name="base_gyro",
        type=sensor.mjSENS_GYRO,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname="imu",
    )
    # What the world body has is ground: the floor, and blocks on it.
    ground: dict[str, Any] = {"objtype": body, "objname": "world"}
    field = mujoco.mjtConDataField
    found_and_force = (1 << int(field.mjCONDATA_FOUND)) | (1 << int(field.mjCONDATA_FORCE))
    and_place = found_and_force | (1 << int(field.mjCONDATA_POS))
    net_force, one_slot = 3, 1
    for side in "lr":
        spec.add_sensor(
            name=f"{side}_sole_force",
            type=sensor.mjSENS_CONTACT,
            **ground,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=sole_geom(side),
            intprm=[and_place, net_force, one_slot],
        )
    spec.add_sensor(
        name="floor_force",
        type=sensor.mjSENS_CONTACT,
        **ground,
        intprm=[found_and_force, net_force, one_slot],
    )


def _add_scenery(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.95, 0.96, 0.98],
        rgb2=[0.75, 0.80, 0.88],
        width=256,
        height=1536,
    )
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=_FLOOR_COLORS[0],
        rgb2=_FLOOR_COLORS[1],
        width=256,
        height=256,
    )
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.quality.offsamples = 4
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    material = spec.add_material(name="floor", texuniform=True, texrepeat=[5, 5])
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    for direction in ((-0.4, 0.6, -1.0), (-0.3, -0.8, -0.6)):
        light = spec.worldbody.add_light(pos=[0.0, 0.0, 3.0], dir=direction, castshadow=False)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.diffuse = [0.5, 0.5, 0.5]
    for name, (position, target) in _CAMERAS.items():
        camera = spec.worldbody.add_camera(name=name, pos=position, fovy=38.0)
        camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
        camera.alt.xyaxes = _camera_axes(np.subtract(target, position))


def _camera_axes(view: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right and up axis of an upright camera that looks along ``view``."""
    right = np.cross(view, [0.0, 0.0, 1.0])
    return np.concatenate((right, np.cross(right, view)))
