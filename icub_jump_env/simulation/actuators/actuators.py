"""The actuators of all joints: command in, joint torque out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.robot import facts
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.servo import JointServo

Array = NDArray[np.float64]

FRICTION_SPEED = 0.05
"""Speed (rad/s) over which Coulomb friction builds up: tanh(s_dot / this). Ours: as small as
the explicit integration at 2 ms bears."""

_NOMINAL = np.ones(facts.N_JOINTS)


class Actuators:
    """Servo or torque loop, then the motor's limits, then friction.

    Attributes:
        friction: (23,) torques that friction takes away (Nm); ``None`` without friction.
        velocity_command: (23,) latest commanded joint velocities (rad/s).
        torque_command: (23,) latest commanded torques (Nm); NaN unless in torque control.
        torque_error: (23,) error of the torque measurement (Nm), set by whoever senses.
    """

    def __init__(
        self,
        config: ActuatorConfig,
        dt: float,
        strength: Array = _NOMINAL,
        gain_scale: Array = _NOMINAL,
    ) -> None:
        """Set up the actuators.

        Args:
            config: Their models.
            dt: Physics step (s).
            strength: (23,) share of their largest torque that the motors reach.
            gain_scale: (23,) factor on the servo gains.
        """
        self._servo = JointServo(dt, config.servo, gain_scale)
        self._loop = config.torque_loop.make(dt)
        self._motor = config.motor.make(strength)
        self._coulomb = config.friction * facts.EFFORT_LIMIT
        self._losses = np.zeros(facts.N_JOINTS)
        self.friction = self._losses if config.friction > 0.0 else None
        self._joint_torque = np.zeros(facts.N_JOINTS)
        self._torque_control = False
        self.velocity_command = np.zeros(facts.N_JOINTS)
        self.torque_command = np.full(facts.N_JOINTS, np.nan)
        self.torque_error = np.zeros(facts.N_JOINTS)

    def reset(self, joint_position: Array, torque: Array) -> None:
        """Hold ``joint_position`` ((23,) rad) with ``torque`` ((23,) Nm)."""
        self._servo.reset(joint_position, torque)
        self._joint_torque[:] = torque
        self._torque_control = False
        self.velocity_command[:] = 0.0
        self.torque_command[:] = np.nan
        self.torque_error[:] = 0.0

    def command(self, command: JointCommand) -> None:
        """Take a new command."""
        torque_control = command.torque is not None
        if torque_control and not self._torque_control:
            self._loop.reset(self._joint_torque)
        self._torque_control = torque_control
        self.torque_command[:] = np.nan if command.torque is None else command.torque
        self.velocity_command[:] = command.velocity
        if command.position is not None:
            self._servo.move_to(command.position)

    def torque(self, joint_position: Array, joint_velocity: Array) -> Array:
        """Advance by one physics step.

        Args:
            joint_position: (23,) as the servos' encoders show it (rad).
            joint_velocity: (23,) rad/s.

        Returns:
            (23,) motor torques on the joint side (Nm), from which ``friction`` goes off; a
            buffer that the next call overwrites.
        """
        if self.friction is not None:
            np.multiply(self._coulomb, np.tanh(joint_velocity / FRICTION_SPEED), out=self.friction)
        if self._torque_control:
            measured = self._joint_torque + self.torque_error
            motor = self._loop.motor_torque(self.torque_command, measured, self._losses)
        else:
            motor = self._servo.torque(self.velocity_command, joint_position, joint_velocity)
        self._motor.limit(motor, joint_velocity)
        np.subtract(motor, self._losses, out=self._joint_torque)
        return motor
