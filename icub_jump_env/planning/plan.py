"""What a plan is, and the set point that it gives the controllers."""

from __future__ import annotations

from typing import Literal, Protocol

from icub_jump_env.records import Array, PerJoint, Record, Vector
from icub_jump_env.robot.statics import Stance

PlannerName = Literal["scaled_curve", "whole_body"]


class Setpoint(Record):
    """What the robot shall do at one instant, SI units, world axes; reused buffers.

    Attributes:
        com_position: (3,) x_dc (m); in a plan from where the CoM is when the jump begins, for
            the controllers in the world, in flight and landing from the middle of the soles.
        com_velocity: (3,) m/s.
        com_acceleration: (3,) m/s^2.
        angular_momentum: (3,) centroidal angular momentum (kg m^2/s).
        angular_momentum_rate: (3,) its derivative (Nm).
        posture: (n,) s_d (rad).
        posture_velocity: (n,) rad/s.
        posture_acceleration: (n,) rad/s^2.
    """

    com_position: Vector
    com_velocity: Vector
    com_acceleration: Vector
    angular_momentum: Vector
    angular_momentum_rate: Vector
    posture: PerJoint
    posture_velocity: PerJoint
    posture_acceleration: PerJoint

    @classmethod
    def at_rest(cls, posture: Array) -> Setpoint:
        """Rest in a posture ((n,) rad) with the CoM at the origin."""
        return cls({"n": len(posture)}, posture=posture)


class JumpPlan(Protocol):
    """The plan of one jump.

    Attributes:
        duration: Take-off time T (s).
        displacement: CoM rise in the launching phase (m).
        stance: How the robot stands when the jump begins.
        landing_posture: (n,) posture of flight and landing (rad).
        retraction_time: How long the motion to it takes in the air (s).
    """

    @property
    def duration(self) -> float: ...  # noqa: D102

    @property
    def displacement(self) -> float: ...  # noqa: D102

    @property
    def stance(self) -> Stance: ...  # noqa: D102

    @property
    def landing_posture(self) -> Array: ...  # noqa: D102

    @property
    def retraction_time(self) -> float: ...  # noqa: D102

    def sample(self, time: float) -> Setpoint:
        """The set point at ``time`` (s) after the start; the next call overwrites it."""
        ...


class Planner(Protocol):
    """Makes the plans of one robot and controller."""

    def plan(self, jump_height: float) -> JumpPlan:
        """The plan of a jump to a commanded height (m)."""
        ...
