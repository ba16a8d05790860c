"""The jump controller: phases, and in each the controller that decides the joints."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.minimum_jerk import MinimumJerk
from icub_jump_env.control.phases import Phase, PhaseMachine
from icub_jump_env.control.qp import QPReport
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.reference.com_reference import ComReference
from icub_jump_env.reference.com_trajectory import PAPER_DISPLACEMENT, ComTrajectory
from icub_jump_env.robot import facts

Array = NDArray[np.float64]

FLIGHT_MOTION_TIME = 0.12
"""Duration of the minimum-jerk motion to the landing posture (s); a flight takes 0.19."""


RESIDUAL_TIME = 0.7
"""How long a residual acts after the launch, where it does (s): a flight takes 0.2 s, and
after half a second on the ground most has happened."""


def landing_posture(crouch: Array, displacement: float) -> Array:
    """Landing posture for a launch of ``displacement`` (m), (23,) rad.

    A short launch takes off from a deeper crouch, from where the legs have to be
    retracted further to clear the ground.
    """
    share = min(1.0, displacement / PAPER_DISPLACEMENT)
    return crouch + share * (facts.LANDING - crouch)


class LaunchController(Protocol):
    """Decides the joints in the launching phase.

    Attributes:
        report: How the latest tick's QP went.
    """

    report: QPReport

    def reset(self) -> None:
        """Forget everything about earlier ticks."""
        ...

    def command(
        self,
        estimator: FeetFixedEstimator,
        joint_position: Array,
        joint_velocity: Array,
        reference: ComReference,
    ) -> JointCommand:
        """One control tick.

        Args:
            estimator: Estimates for the present encoder readings.
            joint_position: (23,) encoder readings (rad).
            joint_velocity: (23,) encoder readings (rad/s).
            reference: CoM reference at the present time.

        Returns:
            The command until the next tick.
        """
        ...


class Tick(NamedTuple):
    """Outcome of one control tick.

    Attributes:
        command: Command to the joint servos.
        report: How the QP went; ``None`` in phases without one.
    """

    command: JointCommand
    report: QPReport | None


class JumpController:
    """Launch on the QP, then minimum jerk to the landing posture, which is held.

    Attributes:
        reference: The CoM reference of the launching phase.
        phases: The phase machine.
        trajectory: The planned CoM trajectory of this jump.
    """

    def __init__(
        self,
        launch: LaunchController,
        crouch: Array,
        dt: float,
        landing_shift: Array | None = None,
    ) -> None:
        """Set up the controller.

        Args:
            launch: Controller of the launching phase.
            crouch: (23,) posture the jump starts from (rad).
            dt: Control period (s).
            landing_shift: (23, 3) joint displacement (rad) per residual (m) in flight and
                landing; by default the residual acts in the launching phase alone.
        """
        self._launch = launch
        self._crouch = crouch
        self._dt = dt
        self._landing_shift = landing_shift
        self.reference = ComReference()
        self.phases = PhaseMachine()
        self.trajectory: ComTrajectory
        self._flight: MinimumJerk | None = None
        self._flight_start = 0.0

    def reset(self, trajectory: ComTrajectory, start_com: Array) -> None:
        """Begin a jump.

        Args:
            trajectory: CoM trajectory of the launching phase.
            start_com: (3,) estimated CoM at the start (m).
        """
        self.trajectory = trajectory
        self.reference.reset(trajectory, start_com)
        self.phases.reset()
        self._launch.reset()
        self._flight = None

    def residual_acts(self, time: float) -> bool:
        """Whether a residual has an effect at ``time`` (s) since the start."""
        if self._landing_shift is None:
            return self.phases.phase is Phase.LAUNCH
        return time < self.trajectory.duration + RESIDUAL_TIME

    def tick(
        self,
        time: float,
        estimator: FeetFixedEstimator,
        joint_position: Array,
        joint_velocity: Array,
        normal_force: float,
        residual_target: Array,
    ) -> Tick:
        """One control tick.

        Args:
            time: Time since the start of the launch (s).
            estimator: Estimates for the present encoder readings.
            joint_position: (23,) encoder readings (rad).
            joint_velocity: (23,) encoder readings (rad/s).
            normal_force: Total measured normal force under the feet (N).
            residual_target: (3,) target offset of the CoM reference (m).

        Returns:
            The command and how it came about.
        """
        phase = self.phases.update(time, self.trajectory.duration, normal_force)
        if phase is Phase.LAUNCH:
            self.reference.update(time)
            self.reference.residual.step(residual_target, self._dt)
            command = self._launch.command(
                estimator, joint_position, joint_velocity, self.reference
            )
            return Tick(command, self._launch.report)

        if self._flight is None:
            goal = landing_posture(self._crouch, self.trajectory.displacement)
            self._flight = MinimumJerk(joint_position.copy(), goal, FLIGHT_MOTION_TIME)
            self._flight_start = time
            self.reference.residual.reset()
        # An early touch-down does not stop the motion, so that chatter cannot either.
        position, velocity = self._flight.sample(time - self._flight_start)
        if self._landing_shift is not None:
            residual = self.reference.residual
            residual.step(residual_target, self._dt)
            position = position + self._landing_shift @ residual.offset
            velocity = velocity + self._landing_shift @ residual.velocity
        return Tick(JointCommand(velocity, position), None)
