"""Low-level joint control: from joint commands to joint torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number
from icub_jump_env.control.command import JointCommand
from icub_jump_env.robot import facts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ServoGains:
    """Gains of the joint servos.

    Attributes:
        stiffness: Torque per position error (Nm/rad); in velocity control per
            integrated velocity error.
        damping: Torque per velocity error (Nm s/rad).
        speed_band: Over this share of the speed limit, above it, the available torque
            falls to zero.

    Raises:
        ConfigError: If a value is out of range.
    """

    stiffness: float = 1500.0
    damping: float = 50.0
    speed_band: float = facts.SPEED_TOLERANCE

    def __post_init__(self) -> None:
        check_number("stiffness", self.stiffness, 1e-3, 1e6)
        check_number("damping", self.damping, 0.0, 1e5)
        check_number("speed_band", self.speed_band, 1e-3, 1.0)


class JointServo:
    """PD control on a position that moves with the commanded velocity.

    In velocity control the servo integrates the command itself, which makes it a PI
    velocity servo. Its position error is kept within what the effort limit can
    use, so that it does not wind up. In torque control it passes the torque on. Above the speed limit it gives less and less
    torque in the direction of motion, and none at 1.03 times the limit. Runs at each
    physics step.

    Attributes:
        velocity_command: (23,) latest commanded joint velocities (rad/s).
        torque_command: (23,) latest commanded torques (Nm); NaN unless in torque control.
    """

    def __init__(self, dt: float, gains: ServoGains | None = None) -> None:
        """Set up the servo.

        Args:
            dt: Physics step (s).
            gains: Gains; the defaults if ``None``.
        """
        gains = gains or ServoGains()
        self._dt = dt
        self._stiffness = gains.stiffness
        self._damping = gains.damping
        self._effort = facts.EFFORT_LIMIT
        band = gains.speed_band * facts.VELOCITY_LIMIT
        self._droop = facts.EFFORT_LIMIT / band
        self._droop_torque = self._droop * (facts.VELOCITY_LIMIT + band)
        self._largest_error = facts.EFFORT_LIMIT / gains.stiffness
        self._reference = np.zeros(facts.N_JOINTS)
        self.velocity_command = np.zeros(facts.N_JOINTS)
        self._torque = np.zeros(facts.N_JOINTS)
        self.torque_command = np.full(facts.N_JOINTS, np.nan)
        self._torque_control = False

    def reset(self, joint_position: Array, torque: Array) -> None:
        """Hold ``joint_position`` ((23,) rad) with ``torque`` ((23,) Nm)."""
        self._reference[:] = joint_position + torque / self._stiffness
        self.velocity_command[:] = 0.0
        self.torque_command[:] = np.nan
        self._torque_control = False

    def command(self, command: JointCommand) -> None:
        """Take a new command."""
        self._torque_control = command.torque is not None
        self.torque_command[:] = np.nan if command.torque is None else command.torque
        self.velocity_command[:] = command.velocity
        if command.position is not None:
            self._reference[:] = command.position

    def torque(self, joint_position: Array, joint_velocity: Array) -> Array:
        """Advance by one physics step.

        Args:
            joint_position: (23,) rad.
            joint_velocity: (23,) rad/s.

        Returns:
            (23,) joint torques (Nm) within the effort limits; a buffer that the next
            call overwrites.
        """
        torque = self._torque
        if self._torque_control:
            torque[:] = self.torque_command
        else:
            self._track(joint_position, joint_velocity, torque)
        braking = self._droop * joint_velocity
        np.minimum(torque, self._droop_torque - braking, out=torque)
        np.maximum(torque, -self._droop_torque - braking, out=torque)
        np.minimum(torque, self._effort, out=torque)
        return np.maximum(torque, -self._effort, out=torque)

    def _track(self, joint_position: Array, joint_velocity: Array, torque: Array) -> None:
        reference = self._reference
        reference += self.velocity_command * self._dt
        error = reference - joint_position
        np.clip(error, -self._largest_error, self._largest_error, out=error)
        np.add(error, joint_position, out=reference)
        np.multiply(error, self._stiffness, out=torque)
        torque += self._damping * (self.velocity_command - joint_velocity)
