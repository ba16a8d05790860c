"""What happens to the robot in the course of an episode: pushes, a spin, another ground."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from icub_jump_env.metrics.jump import AIRBORNE_FORCE
from icub_jump_env.robot.mujoco_model import (
    BLOCK_HALF_SIZE,
    EDGE_GEOM,
    FLOOR_GEOM,
    STEP_GEOM,
    sole_geom,
)
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import World

PUSH_DURATION = 0.05
"""How long the force of a push acts (s); our choice."""

AIRBORNE_TIME = 0.005
"""A rising robot has lifted off once the ground has carried nothing for so long (s)."""

EDGE_DISTANCE = 0.02
"""From the middle of the left sole to where the edge begins (m)."""


class Stage(enum.Enum):
    """Which event is awaited."""

    LIFT_OFF = enum.auto()
    APEX = enum.auto()
    TOUCHDOWN = enum.auto()
    NONE = enum.auto()


@dataclass(frozen=True)
class Push:
    """A constant horizontal force on the chest's CoM: from ``start`` to ``end`` (s), x and y (N)."""

    start: float
    end: float
    x: float
    y: float

    @staticmethod
    def of(impulse: float, direction: float, start: float) -> Push:
        """The push that gives ``impulse`` (N s) along ``direction`` (rad), from ``start`` (s)."""
        force = impulse / PUSH_DURATION
        return Push(
            start, start + PUSH_DURATION, force * math.cos(direction), force * math.sin(direction)
        )


class Disturbances:
    """Disturbs one episode as its world says.

    Each event comes once. Lift-off: the ground has carried less than 1 N for 5 ms while the CoM
    rises. Apex: the CoM does not rise any more. Touch-down: the ground carries 1 N again. All
    are noticed at the physics step after.
    """

    def __init__(self, physics: Physics, world: World, launch_duration: float) -> None:
        """Set up the disturbances; the episode begins.

        Args:
            physics: The MuJoCo world.
            world: What was drawn.
            launch_duration: In which the push of the launch has to fit (s).
        """
        self._physics = physics
        self._world = world
        model = physics.model
        self._dt = float(model.opt.timestep)
        self._ground_force = int(model.sensor("floor_force").adr[0]) + 3
        self._rise = int(model.sensor("com_velocity").adr[0]) + 2
        self._airborne_steps = 0
        self._pushes: list[Push] = []
        self._stage = Stage.LIFT_OFF if _has_events(world) else Stage.NONE
        if world.push != 0.0:
            start = world.push_time * (launch_duration - PUSH_DURATION)
            self._pushes.append(Push.of(world.push, world.push_direction, start))

    @staticmethod
    def of(physics: Physics, world: World, launch_duration: float) -> Disturbances | None:
        """The disturbances of a world; None where there are none, which costs no time."""
        if world.push == 0.0 and not _has_events(world):
            return None
        return Disturbances(physics, world, launch_duration)

    def act(self) -> None:
        """Do what is due; call before each physics step."""
        data = self._physics.data
        if self._stage is not Stage.NONE:
            sensors = data.sensordata
            self._watch(sensors[self._ground_force], sensors[self._rise])
        time, x, y = data.time, 0.0, 0.0
        for push in self._pushes:
            if push.start <= time < push.end:
                x += push.x
                y += push.y
        self._physics.chest_force[:2] = x, y

    def _watch(self, ground_force: float, rise: float) -> None:
        """Notice events from the vertical ground force (N) and the vertical CoM velocity (m/s)."""
        world, airborne = self._world, ground_force < AIRBORNE_FORCE
        if self._stage is Stage.LIFT_OFF:
            self._airborne_steps = self._airborne_steps + 1 if airborne and rise > 0.0 else 0
            if self._airborne_steps * self._dt >= AIRBORNE_TIME - 1e-9:
                self._stage = Stage.APEX
                self._spin(world.takeoff_spin)
                self._push(world.flight_push, world.flight_push_direction, world.flight_push_time)
        elif self._stage is Stage.APEX:
            if rise <= 0.0:
                self._stage = Stage.TOUCHDOWN
                self._change_ground()
        elif not airborne:
            self._stage = Stage.NONE
            self._push(world.landing_push, world.landing_push_direction, world.landing_push_time)

    def _push(self, impulse: float, direction: float, delay: float) -> None:
        if impulse != 0.0:
            # Between two steps, so that rounding does not change for how many of them it acts.
            start = self._physics.data.time + delay - self._dt / 2
            self._pushes.append(Push.of(impulse, direction, start))

    def _spin(self, rate: float) -> None:
        """Add an angular velocity (rad/s) about +y and the CoM to the robot as a whole."""
        if rate == 0.0:
            return
        data = self._up_to_date()
        omega = np.array([0.0, rate, 0.0])
        data.qvel[:3] += np.cross(omega, data.qpos[:3] - data.subtree_com[1])
        data.qvel[3:6] += omega @ data.xmat[1].reshape(3, 3)

    def _change_ground(self) -> None:
        """Tilt the floor and put the blocks on it."""
        world, model = self._world, self._physics.model
        tilted = world.floor_tilt != 0.0 or world.floor_tilt_lateral != 0.0
        if not tilted and world.step == 0.0 and world.edge == 0.0:
            return
        data = self._up_to_date()
        left, right = (data.geom_xpos[model.geom(sole_geom(side)).id] for side in "lr")
        pivot = (left + right) / 2
        pivot[2] = 0.0
        tilt = ground_rotation(world.floor_tilt, world.floor_tilt_lateral)

        def place(name: str, position: tuple[float, float, float]) -> None:
            """Put a geometry where it is on the level floor (m), then tilt it with the floor."""
            geom = model.geom(name).id
            model.geom_pos[geom] = pivot + tilt.apply(position - pivot)
            model.geom_quat[geom] = tilt.as_quat(scalar_first=True)
            model.geom_sameframe[geom] = 0  # else MuJoCo does not look at these two

        length, width, height = BLOCK_HALF_SIZE
        y = pivot[1] + width
        if tilted:
            place(FLOOR_GEOM, (0.0, 0.0, 0.0))
        if world.step != 0.0:
            place(STEP_GEOM, (left[0], y, world.step - height))
        if world.edge != 0.0:
            x = left[0] + math.copysign(EDGE_DISTANCE + length, world.edge)
            place(EDGE_GEOM, (x, y, world.step + abs(world.edge) - height))
        # Its bounding volumes stay where they were when the model was compiled.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE

    def _up_to_date(self) -> mujoco.MjData:
        """The data with positions of the present state; the next step computes the same again."""
        model, data = self._physics.model, self._physics.data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        return data


def ground_rotation(slope: float, lateral_slope: float) -> Rotation:
    """Rotation of level ground to slopes (rad) uphill in +x and in +y, as those of a world."""
    uphill = Rotation.from_rotvec([0.0, -slope, 0.0])
    return uphill * Rotation.from_rotvec([lateral_slope, 0.0, 0.0])


def _has_events(world: World) -> bool:
    return any(
        (
            world.takeoff_spin, world.flight_push, world.floor_tilt, world.floor_tilt_lateral,
            world.step, world.edge, world.landing_push,
        )
    )  # fmt: skip
