"""What we believe of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(slots=True)
class RobotState:
    """Believed state at one control tick, SI units, world frame.

    An estimator fills one instance again and again; arrays may be views of its readings
    and of the model that it keeps up to date.

    Attributes:
        joint_position: (n,) s (rad).
        joint_velocity: (n,) rad/s.
        base_rotation: (3, 3) orientation of the base.
        angular_velocity: (3,) of the base (rad/s).
        com: (3,) CoM position x (m).
        com_velocity: (3,) CoM velocity (m/s).
        angular_momentum: (3,) centroidal angular momentum H_omega (kg m^2/s).
        foot_force: (2,) normal force under the left and right sole (N).
        sole_position: (2, 3) middle of the underside of the left and right sole (m).
        gravity: (3,) direction of gravity, unit vector; where the floor is level, -z.
    """

    joint_position: Array
    joint_velocity: Array
    base_rotation: Array
    angular_velocity: Array
    com: Array
    com_velocity: Array
    angular_momentum: Array
    foot_force: Array
    sole_position: Array
    gravity: Array
