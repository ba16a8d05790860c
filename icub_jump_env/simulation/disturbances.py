"""What happens to the robot in the course of an episode: pushes, a spin, another ground."""

from __future__ import annotations

import math
from typing import Annotated

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from icub_jump_env.compiled import compiled
from icub_jump_env.metrics.recorder import AIRBORNE_FORCE
from icub_jump_env.records import Array, Block, Number, Record
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


NONE, LIFT_OFF, APEX, TOUCHDOWN = range(4)
"""Which event is awaited."""


class Awaited(Record):
    """What comes in an episode.

    Attributes:
        dt: Physics step (s).
        stage: The event that is awaited.
        ground_force, rise: Where in ``sensordata`` the ground's vertical force (N) and the CoM's
            vertical velocity (m/s) are.
        airborne_steps: For how many steps a rising robot has been in the air.
        pushes: (3, 4) constant forces on the chest's CoM: begin and end (s), x and y (N).
    """

    dt: Number
    stage: Number
    ground_force: Number
    rise: Number
    airborne_steps: Number
    pushes: Annotated[Array, (3, 4)]


class Disturbances:
    """Disturbs one episode as its world says.

    Each event comes once. Lift-off: the ground has carried less than 1 N for 5 ms while the CoM
    rises. Apex: the CoM does not rise any more. Touch-down: the ground carries 1 N again. All
    are noticed at the physics step after.

    Attributes:
        awaited: What comes.
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
        self.awaited = Awaited(
            dt=model.opt.timestep,
            stage=LIFT_OFF if _has_events(world) else NONE,
            ground_force=model.sensor("floor_force").adr[0] + 3,
            rise=model.sensor("com_velocity").adr[0] + 2,
        )
        self._n_pushes = 0
        if world.push != 0.0:
            start = world.push_time * (launch_duration - PUSH_DURATION)
            self._push(world.push, world.push_direction, start)

    def happen(self) -> None:
        """The awaited event has come."""
        awaited, world = self.awaited, self._world
        # Between two steps, so that rounding does not change for how many of them a push acts.
        now = self._physics.data.time - awaited.dt / 2
        if awaited.stage == LIFT_OFF:
            awaited.stage = APEX
            self._spin(world.takeoff_spin)
            start = now + world.flight_push_time
            self._push(world.flight_push, world.flight_push_direction, start)
        elif awaited.stage == APEX:
            awaited.stage = TOUCHDOWN
            self._change_ground()
        else:
            awaited.stage = NONE
            start = now + world.landing_push_time
            self._push(world.landing_push, world.landing_push_direction, start)

    @property
    def last_push(self) -> float:
        """When the last push so far ends (s)."""
        return float(self.awaited.pushes[:, 1].max())

    def _push(self, impulse: float, direction: float, start: float) -> None:
        if impulse != 0.0:
            force = impulse / PUSH_DURATION
            self.awaited.pushes[self._n_pushes] = (
                start, start + PUSH_DURATION, force * math.cos(direction), force * math.sin(direction),
            )  # fmt: skip
            self._n_pushes += 1

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


@compiled
def comes(sensordata: Array, awaited: Block) -> bool:
    """Whether the awaited event has come; call once before each physics step."""
    a = awaited[0]
    if a.stage == NONE:
        return False
    airborne = sensordata[int(a.ground_force)] < AIRBORNE_FORCE
    rises = sensordata[int(a.rise)] > 0.0
    if a.stage == LIFT_OFF:
        a.airborne_steps = a.airborne_steps + 1.0 if airborne and rises else 0.0
        lifted: bool = a.airborne_steps * a.dt >= AIRBORNE_TIME - 1e-9
        return lifted
    return not rises if a.stage == APEX else not airborne


@compiled
def push(time: float, awaited: Block, force: Array) -> None:
    """Set the external force on the chest, (3,) (N), at a time (s)."""
    pushes = awaited[0].pushes
    force[0] = force[1] = 0.0
    for k in range(pushes.shape[0]):
        if pushes[k, 0] <= time < pushes[k, 1]:
            force[0] += pushes[k, 2]
            force[1] += pushes[k, 3]
