"""Flight: minimum jerk to the landing posture (paper section III-C)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.phases import Tick
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.minimum_jerk import MinimumJerk
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.planning.residual import ResidualFilter

Array = NDArray[np.float64]


class MinimumJerkFlight:
    """Moves the joints to the landing posture and holds it."""

    def __init__(self, residual: ResidualFilter, dt: float, shift: Array | None) -> None:
        """Set up the phase.

        Args:
            residual: The filter of the residual.
            dt: Control period (s).
            shift: (n, 3) joint displacement (rad) per residual (m); ``None`` if the
                residual acts in the launching phase alone.
        """
        self._residual, self._dt, self._shift = residual, dt, shift
        self._motion: MinimumJerk
        self._began = 0.0

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        self._motion = MinimumJerk(
            state.joint_position.copy(), plan.landing_posture, plan.retraction_time
        )
        self._began = time
        self._residual.reset()

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        position, velocity = self._motion.sample(time - self._began)
        if self._shift is not None:
            self._residual.step(residual_target, self._dt)
            position = position + self._shift @ self._residual.offset
            velocity = velocity + self._shift @ self._residual.velocity
        return Tick(JointCommand(velocity, position), None)
