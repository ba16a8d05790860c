"""The actuators of all joints: command in, joint torque out."""

from __future__ import annotations

import math

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.control.command import JointCommand
from icub_jump_env.records import Array, Block
from icub_jump_env.robot.robot import Robot
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.drives import Drives
from icub_jump_env.simulation.actuators.motors import limited
from icub_jump_env.simulation.actuators.servo import servo_torque
from icub_jump_env.simulation.actuators.torque_loops import loop_torque

FRICTION_SPEED = 0.05
"""Speed (rad/s) over which Coulomb friction builds up: tanh(s_dot / this). Ours: as small as
the explicit integration at 2 ms bears."""


class Actuators:
    """Servo or torque loop, then the motor's limits, then friction.

    Attributes:
        drives: What they are and their state.
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
        loop = config.torque_loop.parameters(dt)
        stiffness = config.servo.stiffness * gain_scale
        effort, stall, droop = config.motor.limits(robot, strength)
        self.drives = Drives(
            {"n": robot.n_joints, "k": loop.delay + 1},
            dt=dt,
            stiffness=stiffness,
            damping=config.servo.damping * gain_scale,
            largest_error=robot.effort_limit / stiffness,
            loop_gain=loop.loop_gain,
            loop_measures=loop.loop_measures,
            friction_compensation=loop.friction_compensation,
            torque_constant=loop.torque_constant,
            coulomb=config.friction * robot.effort_limit,
            effort=effort,
            stall=stall,
            droop=droop,
            torque_command=np.nan,
        )

    def reset(self, joint_position: Array, torque: Array) -> None:
        """Hold ``joint_position`` ((n,) rad) with ``torque`` ((n,) Nm)."""
        drives = self.drives
        drives.reference[:] = joint_position + torque / drives.stiffness
        drives.joint_torque[:] = torque
        drives.torque_control = 0.0
        drives.velocity_command[:] = 0.0
        drives.torque_command[:] = np.nan
        drives.torque_error[:] = 0.0
        drives.loop_torque[:], drives.measured[:], drives.oldest = 0.0, 0.0, 0.0
        drives.friction[:] = 0.0

    def command(self, command: JointCommand) -> None:
        """Take a new command."""
        drives = self.drives
        if command.torque is None:
            drives.torque_control, drives.torque_command[:] = 0.0, np.nan
        else:
            take_torque(command.torque, drives.block)
        drives.velocity_command[:] = 0.0 if command.velocity is None else command.velocity
        if command.position is not None:
            drives.reference[:] = command.position


@compiled
def take_torque(command: Array, drives: Block) -> None:
    """Take torques to control; where others did so before, the torque loops begin anew.

    Args:
        command: (n,) joint torques (Nm), NaN for joints that stay with the servo.
        drives: Block of the :class:`Drives`.
    """
    d, changed = drives[0], False
    for j in range(command.shape[0]):
        changed = changed or math.isnan(command[j]) != math.isnan(d.torque_command[j])
        d.torque_command[j] = command[j]
    d.torque_control = 1.0
    if changed:
        d.loop_torque[:] = d.joint_torque
        d.measured[:] = d.joint_torque


@compiled
def actuate(position: Array, velocity: Array, drives: Block, torque: Array) -> None:
    """Advance the actuators by one physics step.

    Args:
        position: (n,) as the servos' encoders show it (rad).
        velocity: (n,) rad/s.
        drives: Block of the :class:`Drives`.
        torque: (n,) motor torques on the joint side (Nm), which this fills.
    """
    d = drives[0]
    n, k = d.measured.shape[1], d.measured.shape[0]
    oldest = int(d.oldest)
    if d.torque_control:
        # The newest measurement replaces the oldest, and is it if there is no delay.
        for j in range(n):
            d.measured[oldest, j] = d.joint_torque[j] + d.torque_error[j]
        oldest = (oldest + 1) % k
        d.oldest = oldest
    for j in range(n):
        if d.coulomb[j] > 0.0:
            d.friction[j] = d.coulomb[j] * math.tanh(velocity[j] / FRICTION_SPEED)
        if d.torque_control and not math.isnan(d.torque_command[j]):
            motor = limited(d, j, loop_torque(d, j, d.measured[oldest, j]), velocity[j])
            d.loop_torque[j] = motor
        else:
            motor = limited(d, j, servo_torque(d, j, position[j], velocity[j]), velocity[j])
        torque[j] = motor
        d.joint_torque[j] = motor - d.friction[j]
