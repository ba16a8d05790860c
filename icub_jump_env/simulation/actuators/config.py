"""Actuator models by name, and from plain mappings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from icub_jump_env.checks import check_number, check_type, store
from icub_jump_env.simulation.actuators.motors import DCMotor, RatedMotor
from icub_jump_env.simulation.actuators.servo import ServoGains
from icub_jump_env.simulation.actuators.torque_loops import (
    CurrentControl,
    IdealTorque,
    TorqueFeedback,
)

ActuatorName = Literal[
    "ideal", "torque_feedback", "current_control", "dc_motor", "original_limits", "realistic"
]

FRICTION = 0.06
"""Coulomb friction of a joint's gear, as a share of its effort limit: 2.2 Nm at the knee.
Assumption; harmonic drives of this size lose a few per cent."""


@dataclass(frozen=True)
class ActuatorConfig:
    """How a joint command becomes a joint torque.

    In velocity and position control the servo drives the motor directly, as the iCub's
    PWM-based position loops do; in torque control the torque loop does. Friction and
    motor limits act in both.

    Attributes:
        servo: Gains of the velocity and position servo.
        torque_loop: Low-level torque control.
        motor: Torque-speed limits.
        friction: Coulomb friction of the gears, as a share of the effort limit.

    Raises:
        ConfigError: If a value is out of range.
    """

    servo: ServoGains = field(default_factory=ServoGains)
    torque_loop: IdealTorque | TorqueFeedback | CurrentControl = field(default_factory=IdealTorque)
    motor: RatedMotor | DCMotor = field(default_factory=RatedMotor)
    friction: float = 0.0

    def __post_init__(self) -> None:
        check_type("servo", self.servo, ServoGains)
        check_type("torque_loop", self.torque_loop, IdealTorque, TorqueFeedback, CurrentControl)
        check_type("motor", self.motor, RatedMotor, DCMotor)
        store(
            self, friction=check_number("friction", self.friction, 0.0, 0.2, "of the effort limit")
        )


ACTUATORS: Mapping[ActuatorName, ActuatorConfig] = MappingProxyType(
    {
        "ideal": ActuatorConfig(),
        "torque_feedback": ActuatorConfig(torque_loop=TorqueFeedback(), friction=FRICTION),
        "current_control": ActuatorConfig(torque_loop=CurrentControl(), friction=FRICTION),
        "dc_motor": ActuatorConfig(motor=DCMotor()),
        # Before the paper raised them; by how much is an assumption.
        "original_limits": ActuatorConfig(motor=DCMotor(current_limit=0.75, voltage_limit=0.8)),
        "realistic": ActuatorConfig(
            torque_loop=TorqueFeedback(), motor=DCMotor(), friction=FRICTION
        ),
    }
)
"""Actuator models by name."""
