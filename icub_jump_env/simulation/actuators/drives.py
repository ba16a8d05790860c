"""What the actuators of all joints are, and their state, as compiled functions take them."""

from __future__ import annotations

from typing import Annotated

from icub_jump_env.records import Array, Number, PerJoint, Record


class Drives(Record):
    """Servos, torque loops, motors and gears of n joints; flags are 0 or 1.

    Attributes:
        dt: Physics step (s).
        stiffness, damping: (n,) gains of the servos (Nm/rad, Nm s/rad).
        largest_error: (n,) position error that the servos use at most (rad).
        reference: (n,) position that moves with the commanded velocity (rad).
        velocity_command: (n,) latest commanded joint velocities (rad/s).
        torque_control: Whether the latest command has torques.
        torque_command: (n,) latest commanded torques (Nm); NaN leaves a joint to its servo.
        torque_error: (n,) error of the torque measurement (Nm).
        loop_gain: Share of an error that the torque loops take off in a step.
        loop_measures: Whether they feed back the measured torque.
        friction_compensation: Share of the friction that they compensate.
        torque_constant: True torque constant over the one that they assume.
        loop_torque: (n,) their motor torques (Nm).
        measured: (k, n) joint torques measured (Nm), a ring; k is their age in steps, plus one.
        oldest: Which row of it is the oldest.
        coulomb: (n,) friction of the gears at speed (Nm).
        friction: (n,) torques that friction takes away (Nm).
        effort: (n,) largest torques of the motors (Nm).
        stall, droop: (n,) their torque at rest without a limit of the current (Nm), and what of it
            is lost with speed (Nm s/rad).
        joint_torque: (n,) what reaches the joints (Nm).
    """

    dt: Number
    stiffness: PerJoint
    damping: PerJoint
    largest_error: PerJoint
    reference: PerJoint
    velocity_command: PerJoint
    torque_control: Number
    torque_command: PerJoint
    torque_error: PerJoint
    loop_gain: Number
    loop_measures: Number
    friction_compensation: Number
    torque_constant: Number
    loop_torque: PerJoint
    measured: Annotated[Array, ("k", "n")]
    oldest: Number
    coulomb: PerJoint
    friction: PerJoint
    effort: PerJoint
    stall: PerJoint
    droop: PerJoint
    joint_torque: PerJoint
