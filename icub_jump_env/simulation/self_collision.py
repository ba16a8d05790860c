"""Whether links of the robot are in each other, whatever the simulation lets them do."""

from __future__ import annotations

import functools

import mujoco
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot.mujoco_model import FLOOR_GEOM, build_model
from icub_jump_env.robot.robot import Robot


class SelfCollision:
    """The collision shapes of the links, beside the simulation."""

    def __init__(self, robot: Robot) -> None:
        """Make the shapes.

        Args:
            robot: The robot.
        """
        self._robot = robot
        self._model = _shapes(robot)
        self._data = mujoco.MjData(self._model)

    def __reduce__(self) -> tuple[type[SelfCollision], tuple[Robot]]:
        return SelfCollision, (self._robot,)

    def overlap(self, qpos: NDArray[np.float64]) -> float:
        """How deep links are in each other.

        Args:
            qpos: (n + 7,) MuJoCo positions.

        Returns:
            The largest depth (m); 0 if there is none.
        """
        model, data = self._model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        return -float(data.contact.dist.min()) if data.ncon else 0.0


@functools.cache
def _shapes(robot: Robot) -> mujoco.MjModel:
    model = build_model(robot, timestep=0.001, self_collision=True)
    model.geom(FLOOR_GEOM).contype = 0  # its contacts are none between links
    return model
