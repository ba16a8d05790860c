"""Vertical CoM trajectory of the launching phase (paper section III-A, Fig. 1).

A normalised velocity curve reaches 1 m/s at 1 s; scaling it in velocity gives the
take-off speed of the commanded jump, scaling it in time gives either the commanded
displacement or a final acceleration of -g.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import CommandNotScalableError
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot
from icub_jump_env.robot.statics import Stance, make_stance

Array = NDArray[np.float64]

ComScaling = Literal["displacement", "acceleration"]

PAPER_DISPLACEMENT = 0.11
"""CoM displacement in the launching phase (m), paper section IV."""

MAX_DISPLACEMENT = 0.15
"""Largest displacement (m): from the crouch at 0.39 m, 0.15 m is 97 % of a straight leg."""

MAX_ACCELERATION = 25.0
"""Largest upward acceleration (m/s^2) of a reference; far more than the legs can give."""


RETRACTION_TIME = 0.12
"""Duration of the minimum-jerk motion to the landing posture (s); a flight takes 0.19."""


@dataclass(frozen=True)
class NormalizedCurve:
    """Velocity u^n (a + b u) on u in [0, 1], with a + b = 1.

    Starts at rest with zero acceleration and ends at velocity 1.

    Attributes:
        order: The exponent n, at least 2.
        end_slope: Acceleration at u = 1 (dimensionless); with the order it fixes a, b.
    """

    order: int
    end_slope: float

    @functools.cached_property
    def a(self) -> float:
        """Coefficient of u^n."""
        return self.order + 1 - self.end_slope

    @functools.cached_property
    def b(self) -> float:
        """Coefficient of u^(n+1)."""
        return self.end_slope - self.order

    def position(self, u: float) -> float:
        """Integral of the velocity from 0 to u."""
        n = self.order
        return float(u ** (n + 1) * (self.a / (n + 1) + self.b * u / (n + 2)))

    def velocity(self, u: float) -> float:
        """Velocity at u."""
        return float(u**self.order * (self.a + self.b * u))

    def acceleration(self, u: float) -> float:
        """Derivative of the velocity at u."""
        n = self.order
        return float(u ** (n - 1) * (n * self.a + (n + 1) * self.b * u))

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration on [0, 1]."""
        n = self.order
        candidates = [1.0]
        if self.b < 0:
            candidates.append(min(1.0, -(n - 1) * self.a / ((n + 1) * self.b)))
        return max(self.acceleration(u) for u in candidates)


DISPLACEMENT_CURVE = NormalizedCurve(order=2, end_slope=2.536)
"""v(u) = 0.464 u^2 + 0.536 u^3: a normalised displacement of 0.289, so that 4 cm and
11 cm take the paper's 0.43 s."""

ACCELERATION_CURVE = NormalizedCurve(order=5, end_slope=-3.68)
"""Decelerates before take-off, so that a final acceleration of -g can be reached: the
displacement is then 2.75 times the jump height, 11 cm at 4 cm."""


class ComSample(NamedTuple):
    """Vertical CoM reference at one instant: rise above the start (m), m/s, m/s^2."""

    position: float
    velocity: float
    acceleration: float


@dataclass(frozen=True)
class ComTrajectory:
    """A normalised curve scaled to a take-off velocity and a duration.

    Attributes:
        curve: The normalised curve.
        takeoff_velocity: Vertical CoM velocity at the end (m/s).
        duration: Take-off time T (s).
    """

    curve: NormalizedCurve
    takeoff_velocity: float
    duration: float

    @functools.cached_property
    def displacement(self) -> float:
        """CoM rise during the launching phase (m)."""
        return self.takeoff_velocity * self.duration * self.curve.position(1.0)

    @property
    def final_acceleration(self) -> float:
        """CoM acceleration at take-off (m/s^2)."""
        return self.takeoff_velocity / self.duration * self.curve.acceleration(1.0)

    def sample(self, time: float, ballistic: bool = False) -> ComSample:
        """The reference at ``time`` (s), held at its ends outside [0, duration].

        Args:
            time: Time since the start (s).
            ballistic: After ``duration`` go on in free fall instead.
        """
        fall = time - self.duration
        if ballistic and fall > 0.0:
            v = self.takeoff_velocity
            return ComSample(
                self.displacement + fall * (v - GRAVITY * fall / 2), v - GRAVITY * fall, -GRAVITY
            )
        u = min(max(time / self.duration, 0.0), 1.0)
        v, T = self.takeoff_velocity, self.duration
        return ComSample(
            v * T * self.curve.position(u),
            v * self.curve.velocity(u),
            v / T * self.curve.acceleration(u),
        )


def takeoff_velocity(jump_height: float) -> float:
    """Take-off velocity (m/s) for a jump height (m): energy conservation, section II-D."""
    return math.sqrt(2 * GRAVITY * jump_height)


def plan_com_trajectory(
    jump_height: float,
    com_displacement: float | None = None,
    com_scaling: ComScaling = "displacement",
) -> ComTrajectory:
    """Scale the normalised trajectory to a jump.

    Args:
        jump_height: Commanded CoM rise in flight (m).
        com_displacement: CoM rise in the launching phase (m); ``None`` means the
            paper's 0.11 m with scaling by displacement. Scaling by acceleration
            has its own, so that it takes only ``None``.
        com_scaling: What fixes the duration: the displacement, or a final
            acceleration of -9.81 m/s^2.

    Returns:
        The trajectory.

    Raises:
        CommandNotScalableError: If no trajectory of this scaling fits the robot.
    """
    velocity = takeoff_velocity(jump_height)
    if com_scaling == "acceleration":
        if com_displacement is not None:
            raise CommandNotScalableError(
                "com_displacement",
                com_displacement,
                "None with com_scaling='acceleration', where the displacement follows "
                "from the jump height",
            )
        curve = ACCELERATION_CURVE
        trajectory = ComTrajectory(curve, velocity, -velocity * curve.end_slope / GRAVITY)
        if trajectory.displacement > MAX_DISPLACEMENT:
            highest = jump_height * MAX_DISPLACEMENT / trajectory.displacement
            highest = math.floor(highest * 1000) / 1000
            raise CommandNotScalableError(
                "jump_height",
                jump_height,
                f"at most {highest:.3f} m with com_scaling='acceleration', whose displacement "
                f"of {trajectory.displacement:.3f} m exceeds {MAX_DISPLACEMENT} m",
            )
        return trajectory

    displacement = PAPER_DISPLACEMENT if com_displacement is None else com_displacement
    curve = DISPLACEMENT_CURVE
    trajectory = ComTrajectory(curve, velocity, displacement / (velocity * curve.position(1.0)))
    peak = velocity / trajectory.duration * curve.peak_acceleration
    if peak > MAX_ACCELERATION:
        needed = displacement * peak / MAX_ACCELERATION
        raise CommandNotScalableError(
            "com_displacement",
            displacement,
            f"at least {needed:.3f} m for jump_height={jump_height!r}: the reference would "
            f"accelerate by {peak:.1f} m/s^2, more than {MAX_ACCELERATION} m/s^2",
        )
    return trajectory


class ScaledCurvePlan:
    """The paper's plan: the scaled curve for the CoM, no momentum, the crouch as posture.

    Attributes:
        trajectory: The scaled curve.
        stance: The robot's crouch.
        landing_posture: (n,) posture of flight and landing (rad).
        retraction_time: How long the motion to it takes in the air (s).
    """

    retraction_time = RETRACTION_TIME

    def __init__(
        self, trajectory: ComTrajectory, robot: Robot, stance: Stance, ballistic: bool = False
    ) -> None:
        """Make the plan.

        Args:
            trajectory: The scaled curve.
            robot: The robot.
            stance: Its crouch.
            ballistic: Whether the CoM falls freely after T, instead of staying where it is.
        """
        self.trajectory = trajectory
        self.stance = stance
        self._ballistic = ballistic
        self._setpoint = Setpoint.at_rest(robot.crouch)
        # A short launch takes off from a deeper crouch, from where the legs have to be
        # retracted further to clear the ground.
        share = min(1.0, trajectory.displacement / PAPER_DISPLACEMENT)
        self.landing_posture: Array = robot.crouch + share * (robot.landing - robot.crouch)

    @property
    def duration(self) -> float:
        """Take-off time T (s)."""
        return self.trajectory.duration

    @property
    def displacement(self) -> float:
        """CoM rise in the launching phase (m)."""
        return self.trajectory.displacement

    def sample(self, time: float) -> Setpoint:
        """The set point at ``time`` (s) after the start; the next call overwrites it."""
        setpoint, rise = self._setpoint, self.trajectory.sample(time, self._ballistic)
        setpoint.com_position[2] = rise.position
        setpoint.com_velocity[2] = rise.velocity
        setpoint.com_acceleration[2] = rise.acceleration
        return setpoint


class ScaledCurvePlanner:
    """Makes scaled curves of one robot."""

    def __init__(
        self,
        kinematics: FeetFixedKinematics,
        com_displacement: float | None = None,
        com_scaling: ComScaling = "displacement",
        ballistic: bool = False,
    ) -> None:
        """Set up the planner; arguments of :func:`plan_com_trajectory` and the plan.

        Args:
            kinematics: The model; it is updated for the crouch.
            com_displacement: m.
            com_scaling: What fixes the duration.
            ballistic: Whether the CoM falls freely after T.
        """
        self._robot = kinematics.robot
        self._stance = make_stance(kinematics, self._robot.crouch)
        self._displacement, self._scaling = com_displacement, com_scaling
        self._ballistic = ballistic

    def plan(self, jump_height: float) -> ScaledCurvePlan:
        """The plan of a jump to a commanded height (m)."""
        trajectory = plan_com_trajectory(jump_height, self._displacement, self._scaling)
        return ScaledCurvePlan(trajectory, self._robot, self._stance, self._ballistic)
