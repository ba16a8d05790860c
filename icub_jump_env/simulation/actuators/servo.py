"""The velocity and position servo of the joints."""

from __future__ import annotations

from dataclasses import dataclass

from icub_jump_env.checks import check_number, store
from icub_jump_env.compiled import compiled
from icub_jump_env.records import Block


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


@compiled
def servo_torque(drives: Block, joint: int, position: float, velocity: float) -> float:
    """PD control on a position that moves with the commanded velocity.

    In velocity control the servo integrates the command itself, which makes it a PI
    velocity servo. Its position error is kept within what the effort limit can use, so
    that it does not wind up. Runs at each physics step.

    Args:
        drives: The actuators; this moves the position.
        joint: Which joint.
        position: Of the encoder (rad).
        velocity: Of the encoder (rad/s).

    Returns:
        Torque (Nm), not limited.
    """
    command, largest = drives.velocity_command[joint], drives.largest_error[joint]
    error = drives.reference[joint] + command * drives.dt - position
    error = max(min(error, largest), -largest)
    drives.reference[joint] = error + position
    braking: float = drives.damping[joint] * (command - velocity)
    torque: float = error * drives.stiffness[joint] + braking
    return torque
