"""Feet at rest: (3c) in velocities, (6c) in accelerations.

The left foot is at rest by the choice of the unknowns; what is left is the right foot
relative to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class FeetVelocity:
    """J_lf nu = J_rf nu = 0, eq. (3c)."""

    size = 6
    weight = scale = 1.0

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        self._kinematics = kinematics

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation; its right side stays zero."""
        rows[:] = self._kinematics.J_feet


class SolesApart(FeetVelocity):
    """J_rf nu - J_lf nu is a vertical speed: the right sole rises, relative to the left one.

    Attributes:
        speed: That speed (m/s).
    """

    speed = 0.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation; its rows have the left foot minus the right one, base axes."""
        J_feet = self._kinematics.J_feet
        rows[:, : J_feet.shape[1]] = J_feet
        np.multiply(self._kinematics.base_rotation[2], -self.speed, out=target[:3])


class FeetAcceleration:
    """J_lf nu_dot + J_lf_dot nu = 0 and the same of the right foot, eq. (6c)."""

    size = 6
    weight = scale = 1.0

    def __init__(self, kinematics: FeetFixedKinematics, dynamics: FeetFixedDynamics) -> None:
        self._kinematics, self._dynamics = kinematics, dynamics

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation."""
        rows[:, :-12] = self._kinematics.J_feet
        target[:] = self._dynamics.foot_bias
