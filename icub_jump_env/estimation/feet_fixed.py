"""CoM, momentum and base from the encoders, assuming that the feet stand still.

Paper, section III-D: "evaluated assuming that the feet are in contact with the ground
and they don't slide nor rotate". After take-off the assumption fails and so do the
estimates (paper, Fig. 4).
"""

from __future__ import annotations

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.linear_algebra import rotate
from icub_jump_env.records import Array, Block
from icub_jump_env.robot.kinematics import FeetFixedKinematics


class FeetFixedEstimator:
    """The estimator of the paper's controllers."""

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        """Set up the estimator.

        Args:
            kinematics: The model that :meth:`estimate` keeps up to date.
        """
        self._kinematics = kinematics
        self._state = RobotState(
            {"n": kinematics.robot.n_joints},
            sole_position=kinematics.sole_positions,
            gravity=(0.0, 0.0, -1.0),
        )

    def reset(self) -> None:
        """Each tick stands for itself."""

    def refresh(self, readings: Readings) -> RobotState:
        """In a copy: the state of the latest readings again."""
        return self.estimate(readings)

    def estimate(self, readings: Readings) -> RobotState:
        """The believed state; the next call overwrites it."""
        kinematics, state = self._kinematics, self._state
        kinematics.update(readings.joint_position)
        believe_feet(kinematics.block, kinematics.J_left, readings.block, state.block)
        return state


@compiled
def believe_feet(kinematics: Block, J_left: Array, readings: Block, state: Block) -> None:
    """The state if both feet stand still.

    Args:
        kinematics: The model, up to date.
        J_left: (6, 6) twist of the left foot of the left leg's joints, base axes.
        readings: Of the encoders and the force sensors.
        state: What this fills, but for soles and gravity, which stay.
    """
    k, told, s = kinematics[0], readings[0], state[0]
    s.joint_position[:] = told.joint_position
    s.joint_velocity[:] = told.joint_velocity
    s.foot_force[:] = told.foot_force
    s.base_rotation[:] = k.base_rotation
    s.com[:] = k.com
    rate = s.joint_velocity
    s.com_velocity[:] = 0.0
    s.angular_momentum[:] = 0.0
    for i in range(3):
        for j in range(rate.shape[0]):
            s.com_velocity[i] += k.centroidal_map[i, j] * rate[j]
            s.angular_momentum[i] += k.centroidal_map[3 + i, j] * rate[j]
    turning = np.zeros(3)
    for i in range(3):
        for j in range(6):
            turning[i] -= J_left[3 + i, j] * rate[j]
    rotate(k.base_rotation, turning, s.angular_velocity)
