"""Low-level torque control: from the torque a controller asks for to the motor's torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from icub_jump_env.checks import check_choice, check_number, store
from icub_jump_env.compiled import compiled
from icub_jump_env.records import Block


class LoopParameters(NamedTuple):
    """A torque loop as :class:`icub_jump_env.simulation.actuators.drives.Drives` has it.

    Attributes:
        loop_gain: Share of an error that it takes off in a step.
        loop_measures: Whether it feeds back the measured torque.
        delay: Age of that (physics steps).
        friction_compensation: Share of the friction that it compensates.
        torque_constant: True torque constant over the one that it assumes.
    """

    loop_gain: float = 1.0
    loop_measures: bool = False
    delay: int = 0
    friction_compensation: float = 0.0
    torque_constant: float = 1.0


@dataclass(frozen=True)
class IdealTorque:
    """The motor gives the torque asked for at once."""

    kind: Literal["ideal"] = "ideal"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("ideal",))

    def parameters(self, dt: float) -> LoopParameters:
        """Its parameters at a physics step of ``dt`` (s)."""
        return LoopParameters()


@dataclass(frozen=True)
class TorqueFeedback:
    """Feedback of the measured joint torque, as on the paper's robot.

    An integrator on the torque error, d tau_m / dt = 2 pi f (tau_d - tau_measured). It
    rejects friction within its bandwidth, and follows every error of the measurement.

    Attributes:
        bandwidth: Of the closed loop, f (Hz). Assumption; the paper says that its loops
            "were tuned for less dynamic tasks".
        delay: Age of the measurement (s). Assumption. The loop is stable while its product
            with the bandwidth is below 1/4, with half a physics step added to the delay.
        kind: Name of this model.

    Raises:
        ConfigError: If a value is out of range.
    """

    bandwidth: float = 20.0
    delay: float = 0.002
    kind: Literal["feedback"] = "feedback"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("feedback",))
        store(self, bandwidth=check_number("bandwidth", self.bandwidth, 0.1, 1000.0, "Hz"))
        store(self, delay=check_number("delay", self.delay, 0.0, 0.1, "s"))

    def parameters(self, dt: float) -> LoopParameters:
        """Its parameters at a physics step of ``dt`` (s)."""
        return LoopParameters(
            loop_gain=-math.expm1(-2 * math.pi * self.bandwidth * dt),
            loop_measures=True,
            delay=round(self.delay / dt),
        )


@dataclass(frozen=True)
class CurrentControl:
    """Control of the motor current, the paper's future work: no torque measurement.

    A first-order lag. Fast and free of measurement errors, but it does not see what the
    gears lose: friction is compensated by a model as far as that is right, and the torque
    is only as exact as the torque constant.

    Attributes:
        bandwidth: Of the current loop (Hz). Assumption.
        friction_compensation: Share of the friction that the model compensates.
            Assumption.
        torque_constant: True torque constant over the one assumed. Assumption.
        kind: Name of this model.

    Raises:
        ConfigError: If a value is out of range.
    """

    bandwidth: float = 200.0
    friction_compensation: float = 0.7
    torque_constant: float = 0.97
    kind: Literal["current"] = "current"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("current",))
        store(self, bandwidth=check_number("bandwidth", self.bandwidth, 0.1, 1e4, "Hz"))
        store(
            self,
            friction_compensation=check_number(
                "friction_compensation", self.friction_compensation, 0.0, 1.5, "of the friction"
            ),
        )
        store(
            self,
            torque_constant=check_number(
                "torque_constant", self.torque_constant, 0.5, 1.5, "of the assumed one"
            ),
        )

    def parameters(self, dt: float) -> LoopParameters:
        """Its parameters at a physics step of ``dt`` (s)."""
        return LoopParameters(
            loop_gain=-math.expm1(-2 * math.pi * self.bandwidth * dt),
            friction_compensation=self.friction_compensation,
            torque_constant=self.torque_constant,
        )


@compiled
def loop_torque(drives: Block, joint: int, measured: float) -> float:
    """Advance a torque loop by one physics step.

    Args:
        drives: The actuators; the newest measurements are in the ring.
        joint: Which joint.
        measured: The measured joint torque that it feeds back, if it does (Nm).

    Returns:
        Motor torque (Nm), which the loop keeps; what limits it sets it there, too, so that no
        loop can wind up.
    """
    asked = drives.torque_command[joint]
    if drives.loop_measures:
        asked += drives.loop_torque[joint] - measured
    else:
        asked += drives.friction_compensation * drives.friction[joint]
        asked *= drives.torque_constant
    # In this form an ideal loop, of gain 1, gives exactly what is asked for.
    gain = drives.loop_gain
    torque: float = gain * asked + (1.0 - gain) * drives.loop_torque[joint]
    drives.loop_torque[joint] = torque
    return torque
