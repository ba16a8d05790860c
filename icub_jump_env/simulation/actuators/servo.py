"""The velocity and position servo of the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number, store

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ServoGains:
    """Gains of the joint servos. Ours: the robot's are not public in these units.

    Attributes:
        stiffness: Torque per position error (Nm/rad); in velocity control per
            integrated velocity error.
        damping: Torque per velocity error (Nm s/rad).

    Raises:
        ConfigError: If a value is out of range.
    """

    stiffness: float = 1500.0
    damping: float = 50.0

    def __post_init__(self) -> None:
        store(self, stiffness=check_number("stiffness", self.stiffness, 1e-3, 1e6, "Nm/rad"))
        store(self, damping=check_number("damping", self.damping, 0.0, 1e5, "Nm s/rad"))


class JointServo:
    """PD control on a position that moves with the commanded velocity.

    In velocity control the servo integrates the command itself, which makes it a PI
    velocity servo. Its position error is kept within what the effort limit can use, so
    that it does not wind up. Runs at each physics step.
    """

    def __init__(self, dt: float, gains: ServoGains, scale: Array, effort_limit: Array) -> None:
        """Set up the servo.

        Args:
            dt: Physics step (s).
            gains: Nominal gains.
            scale: (n,) factor on the gains of each joint.
            effort_limit: (n,) largest torques (Nm).
        """
        self._dt = dt
        self._stiffness = gains.stiffness * scale
        self._damping = gains.damping * scale
        self._largest_error = effort_limit / self._stiffness
        self._reference = np.zeros_like(effort_limit)
        self._torque = np.zeros_like(effort_limit)

    def reset(self, joint_position: Array, torque: Array) -> None:
        """Hold ``joint_position`` ((n,) rad) with ``torque`` ((n,) Nm)."""
        self._reference[:] = joint_position + torque / self._stiffness

    def move_to(self, position: Array) -> None:
        """Set the position ((n,) rad) that moves on with the commanded velocity."""
        self._reference[:] = position

    def torque(
        self, velocity_command: Array, joint_position: Array, joint_velocity: Array
    ) -> Array:
        """Advance by one physics step.

        Args:
            velocity_command: (n,) rad/s.
            joint_position: (n,) encoders (rad).
            joint_velocity: (n,) encoders (rad/s).

        Returns:
            (n,) torques (Nm), not limited; a buffer that the next call overwrites.
        """
        reference, torque = self._reference, self._torque
        reference += velocity_command * self._dt
        error = reference - joint_position
        np.minimum(error, self._largest_error, out=error)
        np.maximum(error, -self._largest_error, out=error)
        np.add(error, joint_position, out=reference)
        np.multiply(error, self._stiffness, out=torque)
        torque += self._damping * (velocity_command - joint_velocity)
        return torque
