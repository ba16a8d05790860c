"""The jump controller: phases, and in each the controller that decides the joints."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.config import ControllerConfig, FlightName, LandingName
from icub_jump_env.control.flight import FeedbackFlight, Flight, MinimumJerkFlight
from icub_jump_env.control.landing import CROUCH_TIME, FeedbackLanding, HoldLanding, Landing
from icub_jump_env.control.launch import Launch
from icub_jump_env.control.phases import Phase, PhaseController, PhaseMachine, Tick
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.lean import lean_correction
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import N_AXES, RESIDUAL_TIME, ResidualConfig, ResidualFilter
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]

REST, SETTLING = 0.7, 0.25
"""How long a robot that jumps again stands after touch-down, and in its next crouch (s)."""


class JumpController:
    """Launch on the QP, then minimum jerk to the landing posture, which is held.

    Or the same by feedback. Where another jump follows, its crouch is part of the landing. The
    jump has a clock of its own: it starts when :meth:`start` is called.

    Attributes:
        reference: The set point of the launching phase.
        residual: The shaped residual.
        phases: The phase machine.
        plan: The plan of this jump.
    """

    def __init__(
        self,
        config: ControllerConfig,
        residual: ResidualConfig,
        kinematics: FeetFixedKinematics,
        lean_correction: bool = False,
        flight_name: FlightName = "minimum_jerk",
        landing_name: LandingName = "hold",
    ) -> None:
        """Set up the controller.

        Args:
            config: The controller of the launching phase, and when phases end.
            residual: How actions move the set point.
            kinematics: The model, which the estimator keeps up to date.
            lean_correction: Whether to correct the launch by the lean.
            flight_name: The controller of the flight.
            landing_name: The controller of the landing.
        """
        dt = 1.0 / config.frequency
        self.residual = ResidualFilter(residual.bandwidth)
        self.reference = Reference(self.residual)
        self.phases = PhaseMachine(config.phases)
        self.plan: JumpPlan
        self._corrects_lean = lean_correction
        self._correction = np.zeros(N_AXES)
        self._began = 0.0
        self._following: JumpPlan | None = None
        self._crouches = self._next_begins = math.inf
        self._in_all_phases = residual.phases == "all"
        shift = None
        if self._in_all_phases:
            shift = kinematics.com_shift(kinematics.robot.landing)
        flight: Flight
        if flight_name == "feedback":
            flight = FeedbackFlight(self.residual, dt, kinematics)
        else:
            flight = MinimumJerkFlight(self.residual, dt, shift)
        landing: Landing
        if landing_name == "feedback":
            landing = FeedbackLanding(flight, self.residual, dt, kinematics, config.solver)
        else:
            landing = HoldLanding(flight)
        # A posture that feedback chose in the air is held as it is.
        self._none_on_the_ground = flight_name == "feedback" and landing_name == "hold"
        self._landing = landing
        self._controllers: dict[Phase, PhaseController] = {
            Phase.LAUNCH: Launch(config.make(kinematics), self.reference, dt),
            Phase.FLIGHT: flight,
            Phase.LANDING: landing,
        }

    def start(
        self,
        plan: JumpPlan,
        state: RobotState,
        time: float,
        gravity: Array,
        following: JumpPlan | None = None,
    ) -> None:
        """Begin a jump.

        Args:
            plan: Its plan.
            state: The believed state.
            time: Time since the start of the episode (s).
            gravity: (3,) its direction in the IMU frame, as it was read.
            following: The plan of the jump after it, in whose crouch it ends.
        """
        self.plan, self._following = plan, following
        self._began = time
        self._crouches = self._next_begins = math.inf
        self.phases.reset()
        if self._corrects_lean:
            self._correction = lean_correction(gravity, plan.stance)
        self._controllers[Phase.LAUNCH].start(state, plan, 0.0)

    @property
    def launching(self) -> bool:
        """Whether the jump is in its launching phase."""
        return self.phases.phase is Phase.LAUNCH

    def jump_time(self, time: float) -> float:
        """Time since the start of the jump (s), at ``time`` (s) of the episode."""
        return time - self._began

    def due(self, time: float) -> JumpPlan | None:
        """The plan of the next jump, if that is to begin at ``time`` (s) of the episode."""
        return self._following if self.jump_time(time) >= self._next_begins else None

    def residual_acts(self, time: float) -> bool:
        """Whether a residual has an effect at ``time`` (s) of the episode."""
        if not self._in_all_phases:
            return self.launching
        if self._none_on_the_ground and self.phases.phase is Phase.LANDING:
            return False
        return self.jump_time(time) < self.plan.duration + RESIDUAL_TIME

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick.

        Args:
            state: The believed state.
            time: Time since the start of the episode (s).
            residual_target: (5,) target offset of the residual (m; kg m^2/s).

        Returns:
            The command and how it came about.
        """
        time = self.jump_time(time)
        before, duration = self.phases.phase, self.plan.duration
        phase = self.phases.update(time, duration, sum(state.foot_force.tolist()))
        controller = self._controllers[phase]
        if phase is not before:
            controller.start(state, self.plan, time)
            if phase is Phase.LANDING:
                self._crouches = time + REST
        if self._following is not None and time >= self._crouches:
            self._landing.crouch(self._following, time)
            self._crouches, self._next_begins = math.inf, time + CROUCH_TIME + SETTLING
        if self._corrects_lean and phase is Phase.LAUNCH:
            residual_target = residual_target + self._correction
        return controller.tick(state, time, residual_target)
