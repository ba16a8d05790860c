"""The phases of a jump (paper section II-D) as one state machine."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from icub_jump_env.checks import check_count, check_number


class Phase(IntEnum):
    """Launching, aerial and landing phase."""

    LAUNCH = 0
    FLIGHT = 1
    LANDING = 2


@dataclass(frozen=True)
class ContactThresholds:
    """When the feet count as lifted and as landed.

    Attributes:
        lift_off: Total normal force (N) below which the feet may have lifted; 3 % of
            the weight.
        touch_down: Total normal force (N) above which an airborne robot has landed.
        lift_off_ticks: Consecutive control ticks below ``lift_off`` that make a
            lift-off; a single one is chatter.

    Raises:
        ConfigError: If a value is out of range.
    """

    lift_off: float = 10.0
    touch_down: float = 30.0
    lift_off_ticks: int = 2

    def __post_init__(self) -> None:
        check_number("lift_off", self.lift_off, 0.0, 1e4)
        # Below the lift-off force, a robot about to take off would count as landed.
        check_number("touch_down", self.touch_down, self.lift_off, 1e4)
        check_count("lift_off_ticks", self.lift_off_ticks, 1)


class PhaseMachine:
    """Launch until T or lift-off, whichever is first; flight until the first contact.

    Phases only move forward. When the launch ends by time the feet still carry load,
    so that flight can end only after a lift-off was seen.

    Attributes:
        phase: The current phase.
        airborne: Whether a lift-off has been detected.
    """

    def __init__(self, thresholds: ContactThresholds | None = None) -> None:
        self._thresholds = thresholds or ContactThresholds()
        self.reset()

    def reset(self) -> None:
        """Back to the launching phase."""
        self.phase = Phase.LAUNCH
        self.airborne = False
        self._unloaded_ticks = 0

    def update(self, time: float, duration: float, normal_force: float) -> Phase:
        """One control tick.

        Args:
            time: Time since the start of the launch (s).
            duration: Take-off time T of the reference (s).
            normal_force: Total measured normal force under the feet (N).

        Returns:
            The phase from now on.
        """
        thresholds = self._thresholds
        if not self.airborne:
            unloaded = normal_force < thresholds.lift_off
            self._unloaded_ticks = self._unloaded_ticks + 1 if unloaded else 0
            self.airborne = self._unloaded_ticks >= thresholds.lift_off_ticks
        if self.phase is Phase.LAUNCH and (self.airborne or time >= duration):
            self.phase = Phase.FLIGHT
        elif self.phase is Phase.FLIGHT and self.airborne and normal_force > thresholds.touch_down:
            self.phase = Phase.LANDING
        return self.phase
