"""What the metrics need to know of the true state: no simulator in sight."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(slots=True)
class TrueState:
    """The true state at one instant, in SI units and the world frame.

    World frame: +x where the robot faces, +y left, +z up. Whoever simulates fills one
    instance again and again; arrays may be views.

    Attributes:
        time: Time since the start of the episode (s).
        com: (3,) CoM position.
        com_velocity: (3,) CoM velocity.
        angular_momentum: (3,) angular momentum about the CoM, H_omega.
        locked_inertia: (3, 3) inertia of the equivalent rigid body about the CoM.
        ground_force: Vertical force of the ground on the robot (N).
        sole_height: Height of the lowest corner of the lower sole (m).
        only_feet_touch: Whether nothing but the soles touches the ground.
        base_pitch: Pitch of the base about +y, zero when upright (rad).
        sole_position: Centres of the left and the right sole, (3,) each.
        chest_up: (3,) the chest's up axis.
        joint_position: (n,) rad.
        joint_velocity: (n,) rad/s.
        joint_torque: (n,) Nm.
    """

    time: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    com_velocity: Array = field(default_factory=lambda: np.zeros(3))
    angular_momentum: Array = field(default_factory=lambda: np.zeros(3))
    locked_inertia: Array = field(default_factory=lambda: np.eye(3))
    ground_force: float = 0.0
    sole_height: float = 0.0
    only_feet_touch: bool = True
    base_pitch: float = 0.0
    sole_position: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(3), np.zeros(3)))
    chest_up: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    joint_position: Array = field(default_factory=lambda: np.zeros(0))
    joint_velocity: Array = field(default_factory=lambda: np.zeros(0))
    joint_torque: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def chest_tilt(self) -> float:
        """Angle between the chest's up axis and +z (rad)."""
        return math.acos(min(1.0, max(-1.0, float(self.chest_up[2]))))
