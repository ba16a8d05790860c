"""Motors: how much torque there is at which speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from icub_jump_env.checks import check_choice, check_number, store
from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block
from icub_jump_env.robot.icub import SPEED_TOLERANCE
from icub_jump_env.robot.robot import Robot


class MotorLimits(NamedTuple):
    """Limits of the motors as :class:`icub_jump_env.simulation.actuators.drives.Drives` has them.

    Attributes:
        effort: (n,) Nm.
        stall: (n,) Nm.
        droop: (n,) Nm s/rad.
    """

    effort: Array
    stall: Array
    droop: Array


@dataclass(frozen=True)
class RatedMotor:
    """Full torque up to the speed limit, beyond which it fades out: the ideal motor.

    Attributes:
        speed_band: Over this share of the speed limit, above it, the available torque
            falls to zero. Our choice.
        kind: Name of this model.

    Raises:
        ConfigError: If a value is out of range.
    """

    speed_band: float = SPEED_TOLERANCE
    kind: Literal["rated"] = "rated"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("rated",))
        store(
            self,
            speed_band=check_number(
                "speed_band", self.speed_band, 1e-3, 1.0, "of the speed limit"
            ),
        )

    def limits(self, robot: Robot, strength: Array) -> MotorLimits:
        """Of motors that reach the (n,) share ``strength`` of their largest torque."""
        slope = 1.0 / (self.speed_band * robot.velocity_limit)
        return MotorLimits(
            effort=robot.effort_limit * strength,
            stall=robot.effort_limit * strength * (1.0 + 1.0 / self.speed_band),
            droop=robot.effort_limit * strength * slope,
        )


@dataclass(frozen=True)
class DCMotor:
    """Torque limited by the current, and by the voltage that the back-EMF leaves.

    With winding resistance R, torque constant k and gear ratio N the voltage limit is a
    line, tau = (N k / R)(V - N k s_dot), given here by its two ends. The paper set both
    limits "to the maximum value"; that is 1 here.

    Attributes:
        current_limit: Largest current as a share of the one that gives the effort limit.
        voltage_limit: Share of the full voltage.
        stall_torque: Torque at rest at the full voltage without a current limit, in
            effort limits. Assumption.
        no_load_speed: Speed without torque at the full voltage, in speed limits.
            Assumption; with both defaults the line leaves the effort limit at 0.94 of
            the speed limit and gives 0.8 of it at the speed limit.
        kind: Name of this model.

    Raises:
        ConfigError: If a value is out of range.
    """

    current_limit: float = 1.0
    voltage_limit: float = 1.0
    stall_torque: float = 4.0
    no_load_speed: float = 1.25
    kind: Literal["dc"] = "dc"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("dc",))
        for name, low, high, unit in (
            ("current_limit", 0.01, 1.0, "of the largest current"),
            ("voltage_limit", 0.01, 1.0, "of the full voltage"),
            ("stall_torque", 1.0, 100.0, "effort limits"),
            ("no_load_speed", 0.1, 10.0, "speed limits"),
        ):
            store(self, **{name: check_number(name, getattr(self, name), low, high, unit)})

    def limits(self, robot: Robot, strength: Array) -> MotorLimits:
        """Of motors that reach the (n,) share ``strength`` of their largest torque."""
        effort = robot.effort_limit * strength
        stall = self.stall_torque * effort
        return MotorLimits(
            effort=self.current_limit * effort,
            stall=self.voltage_limit * stall,
            droop=stall / (self.no_load_speed * robot.velocity_limit),
        )


@compiled
def limited(drives: Block, joint: int, torque: float, velocity: float) -> float:
    """A torque (Nm) within the effort, and below a line that falls with the speed (rad/s)."""
    braking: float = drives.droop[joint] * velocity
    stall: float = drives.stall[joint]
    effort: float = drives.effort[joint]
    torque = max(min(torque, stall - braking), -stall - braking)
    return max(min(torque, effort), -effort)
