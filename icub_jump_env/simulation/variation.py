"""Changing the MuJoCo model into the world that was drawn."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.mujoco_model import sole_geom
from icub_jump_env.robot.robot import Robot
from icub_jump_env.simulation.randomization import World

Array = NDArray[np.float64]

_VARIED = (
    "body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_damping", "geom_friction",
    "geom_pos", "geom_quat",
)  # fmt: skip
"""The last two are those of the ground, which changes in the course of an episode."""


class ModelVariation:
    """Keeps the nominal values of a model, to which every world is applied afresh."""

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        self._chest = model.body(robot.chest_link).id
        self._nominal = {name: getattr(model, name).copy() for name in _VARIED}
        self._disabled = model.opt.disableflags
        soles = (model.geom(sole_geom(side)).id for side in "lr")
        self._soles_and_ground = [*soles, *np.flatnonzero(model.geom_bodyid == 0)]

    def apply(self, world: World, model: mujoco.MjModel) -> None:
        """Turn ``model`` into ``world``. Motors and sensors are not part of the model."""
        for name, values in self._nominal.items():
            getattr(model, name)[:] = values
        model.opt.disableflags = self._disabled
        model.body_mass[1:] *= world.link_mass
        model.body_inertia[1:] *= world.link_mass[:, None]
        _add_point_mass(model, self._chest, world.payload_mass, world.payload_offset)
        model.dof_damping[6:] *= world.damping
        # A contact takes the larger friction of its two geoms: both get the same.
        model.geom_friction[self._soles_and_ground, 0] = world.friction
        downhill = -GRAVITY * math.cos(world.slope)
        model.opt.gravity[:] = (
            -GRAVITY * math.sin(world.slope),
            downhill * math.sin(world.lateral_slope),
            downhill * math.cos(world.lateral_slope),
        )
        # Subtree masses, geom_sameframe and the like follow from the above. The scratch data
        # keeps the simulation's own from being moved to the reference configuration.
        mujoco.mj_setConst(model, mujoco.MjData(model))


def _add_point_mass(model: mujoco.MjModel, body: int, mass: float, offset: Array) -> None:
    """Add ``mass`` (kg) to a body, ``offset`` (m, body axes) from its CoM."""
    if mass == 0.0:
        return
    old = model.body_mass[body]
    shift = offset * mass / (old + mass)
    axes = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    inertia += _point_inertia(old, shift) + _point_inertia(mass, offset - shift)
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.linalg.det(axes)  # a rotation, not a reflection
    model.body_mass[body] = old + mass
    model.body_ipos[body] += shift
    model.body_inertia[body] = moments
    model.body_iquat[body] = Rotation.from_matrix(axes).as_quat(scalar_first=True)


def _point_inertia(mass: float, offset: Array) -> Array:
    inertia: Array = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return inertia
