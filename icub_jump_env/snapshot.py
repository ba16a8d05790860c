"""What a figure or a log wants to know of one instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Snapshot:
    """True state, reference and command at one instant, SI units, world frame.

    Attributes:
        time: Time since the start (s).
        phase: ``launch``, ``flight`` or ``landing``.
        joint_position: (23,) rad.
        joint_velocity: (23,) rad/s.
        encoder_position: (23,) what the encoders say, which is what the controllers know (rad). The
            true values are those at the beginning of the last physics step, these at its end.
        encoder_velocity: (23,) rad/s.
        joint_velocity_command: (23,) latest command to the servos (rad/s).
        joint_torque: (23,) Nm.
        joint_torque_command: (23,) latest torque command (Nm); NaN in other modes than
            torque control.
        com: (3,) true CoM position (m).
        com_velocity: (3,) true CoM velocity (m/s).
        angular_momentum: (3,) true angular momentum about the CoM (kg m^2/s).
        com_estimate: (3,) CoM position that the controllers believe in (m): from the encoders,
            as if the feet stood still.
        com_reference: (3,) CoM reference (m); NaN after the launching phase.
        base_pitch: Pitch of the base (rad), zero when upright.
        ground_force: Vertical ground force (N).
    """

    time: float
    phase: str
    joint_position: Array
    joint_velocity: Array
    encoder_position: Array
    encoder_velocity: Array
    joint_velocity_command: Array
    joint_torque: Array
    joint_torque_command: Array
    com: Array
    com_velocity: Array
    angular_momentum: Array
    com_estimate: Array
    com_reference: Array
    base_pitch: float
    ground_force: float
