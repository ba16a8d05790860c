"""CoM, momentum and base from the encoders, assuming that the feet stand still.

Paper, section III-D: "evaluated assuming that the feet are in contact with the ground
and they don't slide nor rotate". After take-off the assumption fails and so do the
estimates (paper, Fig. 4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class FeetFixedEstimator:
    """Estimates that the controllers and the observation use, world frame.

    Attributes:
        kinematics: Feet-fixed kinematics at the latest joint positions.
        com: (3,) CoM position x (m).
        com_velocity: (3,) CoM velocity (m/s).
        angular_momentum: (3,) centroidal angular momentum H_omega (kg m^2/s).
    """

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        self.kinematics = kinematics
        self.com = np.zeros(3)
        self._rates = np.zeros(6)
        self.com_velocity, self.angular_momentum = self._rates[:3], self._rates[3:]

    def __reduce__(self) -> tuple[type[FeetFixedEstimator], tuple[FeetFixedKinematics]]:
        # Every update overwrites all attributes, two of which are views.
        return FeetFixedEstimator, (self.kinematics,)

    def update(self, joint_position: Array, joint_velocity: Array) -> None:
        """Take in encoder readings, (23,) rad and (23,) rad/s."""
        kinematics = self.kinematics
        kinematics.update(joint_position)
        self.com[:] = kinematics.com
        np.dot(kinematics.centroidal_map, joint_velocity, out=self._rates)
