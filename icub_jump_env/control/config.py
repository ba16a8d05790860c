"""The configurations of the controllers: gains, weights, margins, horizons, contact limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from icub_jump_env.checks import (
    check_choice,
    check_count,
    check_flag,
    check_number,
    check_type,
    store,
)
from icub_jump_env.errors import ConfigError
from icub_jump_env.robot.kinematics import FeetFixedKinematics

if TYPE_CHECKING:
    from icub_jump_env.control.launch import TrackingController

ControllerName = Literal["velocity", "torque"]
SolverName = Literal["daqp", "osqp"]
Constraints = Literal["soft", "hard"]
FlightName = Literal["minimum_jerk", "feedback"]
LandingName = Literal["hold", "feedback"]
LaunchEnd = Literal["time", "lift_off"]

Weights = tuple[float, ...]
"""One weight for legs, torso and arms each, or one per joint."""


@dataclass(frozen=True)
class PhaseConfig:
    """When a phase ends.

    Attributes:
        launch_end: ``time``: at T or at lift-off, whichever is first. ``lift_off``: at
            lift-off alone; from T on the CoM reference falls freely.
        lift_off: Total normal force (N) below which the feet may have lifted in the launch;
            3 % of the weight. After it ``touch_down`` tells.
        touch_down: Total normal force (N) above which an airborne robot has landed.
        lift_off_ticks: Consecutive control ticks below ``lift_off`` that make a
            lift-off; a single one is chatter.

    Raises:
        ConfigError: If a value is out of range.
    """

    launch_end: LaunchEnd = "time"
    lift_off: float = 10.0
    touch_down: float = 30.0
    lift_off_ticks: int = 2

    def __post_init__(self) -> None:
        check_choice("launch_end", self.launch_end, get_args(LaunchEnd))
        store(self, lift_off=check_number("lift_off", self.lift_off, 0.0, 1e4, "N"))
        # Below the lift-off force, a robot about to take off would count as landed.
        store(
            self, touch_down=check_number("touch_down", self.touch_down, self.lift_off, 1e4, "N")
        )
        store(
            self,
            lift_off_ticks=check_count("lift_off_ticks", self.lift_off_ticks, 1, unit="ticks"),
        )


@dataclass(frozen=True)
class ContactConfig:
    """Limits of the contact wrench of one sole (6f).

    Attributes:
        friction: Coulomb friction that the controller counts on, less than the floor's
            0.8 to keep a margin.
        torsional_friction: Largest yaw moment per normal force (m); our assumption.
        minimum_force: Smallest normal force of each foot (N).

    Raises:
        ConfigError: If a value is out of range.
    """

    friction: float = 0.5
    torsional_friction: float = 0.02
    minimum_force: float = 10.0

    def __post_init__(self) -> None:
        _store_numbers(
            self,
            friction=(0.0, 5.0, ""),
            torsional_friction=(0.0, 1.0, "m"),
            minimum_force=(0.0, 1e3, "N"),
        )


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """What both controllers have in common.

    Attributes:
        frequency: Control rate (Hz), a divisor of the physics rate.
        solver: QP solver.
        constraints: Whether the CoM task (3b), (6b) and the momentum constraint (3d), (6d)
            are constraints, as printed, or heavily weighted costs. A tick whose hard QP has
            no solution counts as a solver failure and is answered by the soft one.
        momentum_control: Pose the constraint on the angular momentum, (3d) or (6d).
        phases: When a phase ends.

    Raises:
        ConfigError: If a value is out of range.
    """

    frequency: float
    solver: SolverName = "daqp"
    constraints: Constraints = "soft"
    momentum_control: bool = True
    phases: PhaseConfig = field(default_factory=PhaseConfig)

    def __post_init__(self) -> None:
        store(self, frequency=check_number("frequency", self.frequency, 1.0, 1e5, "Hz"))
        check_choice("solver", self.solver, get_args(SolverName))
        check_choice("constraints", self.constraints, get_args(Constraints))
        store(self, momentum_control=check_flag("momentum_control", self.momentum_control))
        check_type("phases", self.phases, PhaseConfig)

    def make(self, kinematics: FeetFixedKinematics) -> TrackingController:
        """The controller of the launching phase. A class of one's own makes one of one's own.

        Args:
            kinematics: The model, which the estimator keeps up to date.
        """
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class VelocityConfig(ControllerConfig):
    """The velocity controller, eq. 3.

    Attributes:
        posture: K_p of the posture task (1/s).
        com: K of the CoM task (1/s).
        momentum: K of the momentum constraint (1/s).
        posture_weight: Diagonal of Lambda: of legs, torso and arms, or per joint.
        smoothness_weight: Diagonal of Delta, likewise.
        com_weight: Weight of the CoM task's residual ((m/s)^-2), if soft.
        momentum_weight: Weight of the momentum residual ((kg m^2/s)^-2), if soft.
        limit_horizon: Position limits must hold if the velocity is kept for this long (s).
            The paper takes one control period, in which no joint can stop.
        velocity_margin: Share of the speed limits that the QP may use; the rest is for
            the servos' overshoot.
        kind: Name of this controller.

    Raises:
        ConfigError: If a value is out of range.
    """

    frequency: float = 200.0
    posture: float = 1.0
    com: float = 10.0
    momentum: float = 10.0
    posture_weight: Weights = (1.0, 1.0, 0.1)
    smoothness_weight: Weights = (0.1, 0.1, 0.01)
    com_weight: float = 1e5
    momentum_weight: float = 1e3
    limit_horizon: float = 0.02
    velocity_margin: float = 0.98
    kind: Literal["velocity"] = "velocity"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("kind", self.kind, ("velocity",))
        _store_numbers(
            self,
            posture=(0.0, 1e3, "1/s"),
            com=(0.0, 1e3, "1/s"),
            momentum=(0.0, 1e3, "1/s"),
            com_weight=(0.0, 1e8, ""),
            momentum_weight=(0.0, 1e8, ""),
            limit_horizon=(0.0, 1.0, "s"),
            velocity_margin=(0.01, 1.0, ""),
        )
        # One of the two must be positive, or the QP has no unique solution.
        _store_weights(self, posture_weight=(1e-6, 1e6), smoothness_weight=(0.0, 1e6))

    def make(self, kinematics: FeetFixedKinematics) -> TrackingController:
        """Eq. 3; see :meth:`ControllerConfig.make`."""
        from icub_jump_env.control.velocity import VelocityController

        return VelocityController(self, kinematics)


@dataclass(frozen=True, kw_only=True)
class TorqueConfig(ControllerConfig):
    """The torque controller, eq. 6.

    Attributes:
        posture_stiffness: K_p of the posture task (1/s^2).
        posture_damping: K_d of the posture task (1/s).
        com_stiffness: K_p of the CoM task (1/s^2).
        com_damping: K_d of the CoM task (1/s).
        momentum: K of the momentum constraint (1/s).
        posture_weight: Diagonal of Lambda ((rad/s^2)^-2): of legs, torso and arms, or per
            joint.
        smoothness_weight: Diagonal of Delta (Nm^-2), likewise.
        com_weight: Weight of the CoM task's residual ((m/s^2)^-2), if soft.
        momentum_weight: Weight of the momentum residual (Nm^-2), if soft.
        wrench_weight: Weight of the contact wrenches (N^-2, (Nm)^-2); makes their
            distribution over the feet unique.
        speed_horizon: Speed limits must hold after this long (s) at the acceleration
            that the QP decides.
        limit_horizon: Position limits likewise (s).
        contact: Limits of the contact wrenches.
        kind: Name of this controller.

    Raises:
        ConfigError: If a value is out of range.
    """

    frequency: float = 500.0
    posture_stiffness: float = 10.0
    posture_damping: float = 6.0
    com_stiffness: float = 200.0
    com_damping: float = 28.0
    momentum: float = 10.0
    posture_weight: Weights = (1.0, 1.0, 0.1)
    smoothness_weight: Weights = (1e-3, 1e-3, 1e-3)
    com_weight: float = 1e4
    momentum_weight: float = 3e3
    wrench_weight: float = 1e-4
    speed_horizon: float = 0.005
    limit_horizon: float = 0.02
    contact: ContactConfig = field(default_factory=ContactConfig)
    kind: Literal["torque"] = "torque"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("kind", self.kind, ("torque",))
        _store_numbers(
            self,
            posture_stiffness=(0.0, 1e5, "1/s^2"),
            posture_damping=(0.0, 1e5, "1/s"),
            com_stiffness=(0.0, 1e5, "1/s^2"),
            com_damping=(0.0, 1e5, "1/s"),
            momentum=(0.0, 1e3, "1/s"),
            com_weight=(0.0, 1e8, ""),
            momentum_weight=(0.0, 1e8, ""),
            wrench_weight=(1e-9, 1.0, ""),
            speed_horizon=(1e-3, 1.0, "s"),
            limit_horizon=(1e-3, 1.0, "s"),
        )
        _store_weights(self, posture_weight=(1e-6, 1e6), smoothness_weight=(0.0, 1e6))
        check_type("contact", self.contact, ContactConfig)

    def make(self, kinematics: FeetFixedKinematics) -> TrackingController:
        """Eq. 6; see :meth:`ControllerConfig.make`."""
        from icub_jump_env.control.torque import TorqueController

        return TorqueController(self, kinematics)


def _store_numbers(config: Any, **ranges: tuple[float, float, str]) -> None:
    for name, (low, high, unit) in ranges.items():
        store(config, **{name: check_number(name, getattr(config, name), low, high, unit)})


def _store_weights(config: Any, **ranges: tuple[float, float]) -> None:
    for name, (low, high) in ranges.items():
        weights = getattr(config, name)
        if not isinstance(weights, list | tuple | np.ndarray):
            raise ConfigError(name, weights, "weights of legs, torso and arms, or per joint")
        store(config, **{name: tuple(check_number(name, w, low, high) for w in weights)})


CONTROLLERS: dict[ControllerName, VelocityConfig | TorqueConfig] = {
    "velocity": VelocityConfig(),
    "torque": TorqueConfig(),
}
"""Controllers by name."""


def check_own(config: VelocityConfig | TorqueConfig) -> None:
    """Refuse a controller of the user's own where a file shall say what jumped.

    Raises:
        ConfigError: If it is of a class of its own.
    """
    if type(config) not in (VelocityConfig, TorqueConfig):
        allowed = "VelocityConfig or TorqueConfig: a file cannot hold a class"
        raise ConfigError("controller", type(config).__qualname__, allowed)
