"""The actuators of all joints: command in, joint torque out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.robot.robot import Robot
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.servo import JointServo

Array = NDArray[np.float64]

FRICTION_SPEED = 0.05
"""Speed (rad/s) over which Coulomb friction builds up: tanh(s_dot / this). Ours: as small as
the explicit integration at 2 ms bears."""


class Actuators:
    """Servo or torque loop, then the motor's limits, then friction.

    Attributes:
        friction: (n,) torques that friction takes away (Nm); ``None`` without friction.
        velocity_command: (n,) latest commanded joint velocities (rad/s).
        torque_command: (n,) latest commanded torques (Nm); NaN unless in torque control.
        torque_error: (n,) error of the torque measurement (Nm), set by whoever senses.
    """

    def __init__(
        self,
        config: ActuatorConfig,
        robot: Robot,
        dt: float,
        strength: Array,
        gain_scale: Array,
    ) -> None:
        """Set up the actuators.

        Args:
            config: Their models.
            robot: Whose they are.
            dt: Physics step (s).
            strength: (n,) share of their largest torque that the motors reach.
            gain_scale: (n,) factor on the servo gains.
        """
        n = robot.n_joints
        self._servo = JointServo(dt, config.servo, gain_scale, robot.effort_limit)
        self._loop = config.torque_loop.make(dt, n)
        self._motor = config.motor.make(robot, strength)
        self._coulomb = config.friction * robot.effort_limit
        self._losses = np.zeros(n)
        self.friction = self._losses if config.friction > 0.0 else None
        self._joint_torque = np.zeros(n)
        self._torque_control = False
        self._servoed = np.ones(n, dtype=bool)
        self._mixed = False
        self.velocity_command = np.zeros(n)
        self.torque_command = np.full(n, np.nan)
        self.torque_error = np.zeros(n)

    def reset(self, joint_position: Array, torque: Array) -> None:
        """Hold ``joint_position`` ((n,) rad) with ``torque`` ((n,) Nm)."""
        self._servo.reset(joint_position, torque)
        self._joint_torque[:] = torque
        self._torque_control = self._mixed = False
        self._servoed[:] = True
        self.velocity_command[:] = 0.0
        self.torque_command[:] = np.nan
        self.torque_error[:] = 0.0

    def command(self, command: JointCommand) -> None:
        """Take a new command."""
        self._torque_control = command.torque is not None
        self.torque_command[:] = np.nan if command.torque is None else command.torque
        servoed = np.isnan(self.torque_command)
        if self._torque_control and (servoed != self._servoed).any():
            self._loop.reset(self._joint_torque)
        self._servoed = servoed
        self._mixed = self._torque_control and bool(servoed.any())
        self.velocity_command[:] = 0.0 if command.velocity is None else command.velocity
        if command.position is not None:
            self._servo.move_to(command.position)

    def torque(self, joint_position: Array, joint_velocity: Array) -> Array:
        """Advance by one physics step.

        Args:
            joint_position: (n,) as the servos' encoders show it (rad).
            joint_velocity: (n,) rad/s.

        Returns:
            (n,) motor torques on the joint side (Nm), from which ``friction`` goes off; a
            buffer that the next call overwrites.
        """
        if self.friction is not None:
            np.multiply(self._coulomb, np.tanh(joint_velocity / FRICTION_SPEED), out=self.friction)
        if self._torque_control:
            measured = self._joint_torque + self.torque_error
            wanted = self.torque_command
            if self._mixed:
                # The loops of joints under the servo have nothing to do.
                wanted = np.where(self._servoed, measured, wanted)
            motor = self._loop.motor_torque(wanted, measured, self._losses)
            if self._mixed:
                servo = self._servo.torque(self.velocity_command, joint_position, joint_velocity)
                motor = np.where(self._servoed, servo, motor)
        else:
            motor = self._servo.torque(self.velocity_command, joint_position, joint_velocity)
        self._motor.limit(motor, joint_velocity)
        np.subtract(motor, self._losses, out=self._joint_torque)
        return motor
