"""CoM, momentum and base from the encoders, assuming that the feet stand still.

Paper, section III-D: "evaluated assuming that the feet are in contact with the ground
and they don't slide nor rotate". After take-off the assumption fails and so do the
estimates (paper, Fig. 4).
"""

from __future__ import annotations

import numpy as np

from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.robot.kinematics import FeetFixedKinematics


class FeetFixedEstimator:
    """The estimator of the paper's controllers."""

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        """Set up the estimator.

        Args:
            kinematics: The model that :meth:`estimate` keeps up to date.
        """
        self._kinematics = kinematics
        self._rates = np.zeros(6)
        n = kinematics.robot.n_joints
        self._state = RobotState(
            joint_position=np.zeros(n),
            joint_velocity=np.zeros(n),
            base_rotation=kinematics.base_rotation,
            angular_velocity=np.zeros(3),
            com=kinematics.com,
            com_velocity=self._rates[:3],
            angular_momentum=self._rates[3:],
            foot_force=np.zeros(2),
            sole_position=kinematics.sole_positions,
            gravity=np.array([0.0, 0.0, -1.0]),
        )

    def __reduce__(self) -> tuple[type[FeetFixedEstimator], tuple[FeetFixedKinematics]]:
        # The state is made of views, which the next estimate fills.
        return FeetFixedEstimator, (self._kinematics,)

    def reset(self) -> None:
        """Each tick stands for itself."""

    def refresh(self, readings: Readings) -> RobotState:
        """In a copy: the state of the latest readings again."""
        return self.estimate(readings)

    def estimate(self, readings: Readings) -> RobotState:
        """The believed state; the next call overwrites it."""
        kinematics, state = self._kinematics, self._state
        kinematics.update(readings.joint_position)
        np.dot(kinematics.centroidal_map, readings.joint_velocity, out=self._rates)
        base_twist = kinematics.J_left.dot(readings.joint_velocity[kinematics.robot.left_leg])
        np.dot(kinematics.base_rotation, -base_twist[3:], out=state.angular_velocity)
        state.joint_position = readings.joint_position
        state.joint_velocity = readings.joint_velocity
        state.foot_force = readings.foot_force
        return state
