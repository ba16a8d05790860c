"""The true state, read from MuJoCo after each physics step."""

from __future__ import annotations

import math

import numpy as np

from icub_jump_env.metrics.state import TrueState
from icub_jump_env.robot.mujoco_model import sole_geom
from icub_jump_env.simulation.physics import Physics


class GroundTruth:
    """Keeps one :class:`TrueState` up to date with the physics.

    ``mj_step`` evaluates positions, velocities and forces at the beginning of the step
    and then integrates. All entries are those of that instant, so that heights,
    momenta and forces belong together.

    Attributes:
        state: The true state; its arrays are views of MuJoCo's.
    """

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        robot, model, data = physics.robot, physics.model, physics.data
        self.state = TrueState(
            com=data.sensor("com").data,
            com_velocity=data.sensor("com_velocity").data,
            angular_momentum=data.sensor("angular_momentum").data,
            joint_position=data.sensordata[_span(physics, "position")],
            joint_velocity=data.sensordata[_span(physics, "velocity")],
            joint_torque=data.actuator_force,
            # The chest's up axis is the y axis of its link frame.
            chest_up=data.xmat[model.body(robot.chest_link).id].reshape(3, 3)[:, 1],
        )
        self._floor = data.sensor("floor_force").data
        self._soles_touching = [data.sensor(f"{side}_sole_force").data for side in "lr"]
        # Body 1 heads the kinematic tree: its composite inertia is about the CoM.
        self._composite_inertia = data.crb[1]
        self._base_rotation = data.xmat[model.body(robot.base_link).id]
        left, right = (model.geom(sole_geom(side)).id for side in "lr")
        self._soles = [
            (data.geom_xpos[geom], data.geom_xmat[geom], model.geom_size[geom])
            for geom in (left, right)
        ]
        self.state.sole_position = data.geom_xpos[left], data.geom_xpos[right]

    def __reduce__(self) -> tuple[type[GroundTruth], tuple[Physics]]:
        # Views of MuJoCo's arrays have to be taken anew from a copy's own data.
        return GroundTruth, (self._physics,)

    def read(self) -> TrueState:
        """Update the state after a physics step."""
        state = self.state
        state.time = self._physics.evaluated_time
        # MuJoCo reports the force of the first geom, the floor, on the robot.
        state.ground_force = float(self._floor[3])
        n_soles = self._soles_touching[0][0] + self._soles_touching[1][0]
        state.only_feet_touch = bool(self._floor[0] == n_soles)
        state.sole_height = min(_lowest_corner(*sole) for sole in self._soles)
        state.base_pitch = math.asin(min(1.0, max(-1.0, self._base_rotation[6])))
        xx, yy, zz, xy, xz, yz = self._composite_inertia[:6]
        state.locked_inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return state


def _span(physics: Physics, quantity: str) -> slice:
    """Where the sensors of all joints stand in ``sensordata``."""
    robot = physics.robot
    start = physics.model.sensor(f"{robot.joint_names[0]}_{quantity}").adr[0]
    return slice(start, start + robot.n_joints)


def _lowest_corner(position: np.ndarray, rotation: np.ndarray, half_size: np.ndarray) -> float:
    return float(position[2] - np.abs(rotation[6:]) @ half_size)
