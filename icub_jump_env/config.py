"""The configuration of a jump: one frozen, validated dataclass."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal, Self, get_args

from icub_jump_env.control.solvers import SolverName
from icub_jump_env.errors import ConfigError
from icub_jump_env.reference.com_trajectory import (
    MAX_DISPLACEMENT,
    ComScaling,
    plan_com_trajectory,
)

ControllerName = Literal["velocity"]
RenderMode = Literal["rgb_array", "human"]

JUMP_HEIGHT_RANGE = (0.005, 0.15)
DISPLACEMENT_RANGE = (0.03, MAX_DISPLACEMENT)
RESIDUAL_RANGE = (0.0, 0.10)
TIMESTEP_RANGE = (1e-5, 2e-3)
AGENT_FREQUENCY_RANGE = (1.0, 1000.0)
STAND_TIME_RANGE = (0.0, 30.0)


@dataclass(frozen=True)
class JumpConfig:
    """Everything ``gymnasium.make("ICubJump-v0", ...)`` takes.

    Attributes:
        controller: Controller of the launching phase.
        jump_height: Commanded rise of the CoM in flight (m).
        com_displacement: Rise of the CoM in the launching phase (m); by default the
            paper's 0.11 with scaling by displacement.
        com_scaling: What fixes the duration of the launch: the CoM displacement, or a
            final CoM acceleration of -9.81 m/s^2.
        momentum_control: Pose the constraint on the angular momentum (eq. 3d).
        solver: QP solver.
        residual_scale: Largest offset of the CoM reference that an action can ask for:
            forward, lateral, vertical (m).
        timestep: Physics step (s).
        control_frequency: Rate of the controller (Hz), a divisor of the physics rate.
        agent_frequency: Rate of ``env.step`` (Hz), a divisor of the control rate.
        stand_time: How long the robot must stand after touch-down (s).
        ankle_shift: Move the ankle pitch range by -15 deg, as the paper did.
        render_mode: None, rgb_array or human.

    Raises:
        ConfigError: If a field is out of range, naming the field, the value and the
            allowed range.
    """

    controller: ControllerName = "velocity"
    jump_height: float = 0.04
    com_displacement: float | None = None
    com_scaling: ComScaling = "displacement"
    momentum_control: bool = True
    solver: SolverName = "daqp"
    residual_scale: tuple[float, float, float] = (0.06, 0.02, 0.02)
    timestep: float = 0.001
    control_frequency: float = 200.0
    agent_frequency: float = 100.0
    stand_time: float = 2.0
    ankle_shift: bool = True
    render_mode: RenderMode | None = None

    def __post_init__(self) -> None:
        _choice("controller", self.controller, get_args(ControllerName))
        _choice("com_scaling", self.com_scaling, get_args(ComScaling))
        _choice("solver", self.solver, get_args(SolverName))
        _choice("render_mode", self.render_mode, (None, *get_args(RenderMode)))
        _flag("momentum_control", self.momentum_control)
        _flag("ankle_shift", self.ankle_shift)
        self._store("jump_height", _number("jump_height", self.jump_height, *JUMP_HEIGHT_RANGE))
        if self.com_displacement is not None:
            self._store(
                "com_displacement",
                _number("com_displacement", self.com_displacement, *DISPLACEMENT_RANGE),
            )
        self._store("residual_scale", _residual_scale(self.residual_scale))
        self._store("timestep", _number("timestep", self.timestep, *TIMESTEP_RANGE))
        self._store("stand_time", _number("stand_time", self.stand_time, *STAND_TIME_RANGE))
        self._check_rates()
        plan_com_trajectory(self.jump_height, self.com_displacement, self.com_scaling)

    def _store(self, field: str, value: Any) -> None:
        object.__setattr__(self, field, value)

    def _check_rates(self) -> None:
        rate = 1.0 / self.timestep
        for field, limits in (
            ("control_frequency", (1.0, rate)),
            ("agent_frequency", AGENT_FREQUENCY_RANGE),
        ):
            frequency = _number(field, getattr(self, field), *limits)
            if not _is_multiple(rate, frequency):
                raise ConfigError(field, frequency, f"a divisor of {rate:g} Hz, the rate below it")
            self._store(field, frequency)
            rate = frequency

    @property
    def control_dt(self) -> float:
        """Control period T_s (s)."""
        return 1.0 / self.control_frequency

    @property
    def physics_per_control(self) -> int:
        """Physics steps per control tick."""
        return round(self.control_dt / self.timestep)

    @property
    def controls_per_step(self) -> int:
        """Control ticks per ``env.step``."""
        return round(self.control_frequency / self.agent_frequency)

    @classmethod
    def from_kwargs(cls, kwargs: Mapping[str, Any]) -> Self:
        """Build from keywords, refusing unknown ones.

        Raises:
            ConfigError: If a keyword is not a field, or a value is out of range.
        """
        names = [field.name for field in dataclasses.fields(cls)]
        for name, value in kwargs.items():
            if name not in names:
                raise ConfigError(name, value, f"no such field; the fields are {', '.join(names)}")
        return cls(**kwargs)

    def with_options(self, options: Mapping[str, Any] | None) -> Self:
        """The configuration of one episode: ``reset(options={"jump_height": ...})``.

        Raises:
            ConfigError: If an option is unknown or out of range.
        """
        if options is None:
            return self
        if not isinstance(options, Mapping):
            raise ConfigError("options", options, "a mapping with the key 'jump_height', or None")
        for name, value in options.items():
            if name != "jump_height":
                raise ConfigError(f"options[{name!r}]", value, "the only option is 'jump_height'")
        return dataclasses.replace(self, **options)


def _choice(field: str, value: Any, allowed: tuple[Any, ...]) -> None:
    if not any(type(value) is type(choice) and value == choice for choice in allowed):
        raise ConfigError(field, value, f"one of {', '.join(map(repr, allowed))}")


def _flag(field: str, value: Any) -> None:
    if not isinstance(value, bool):
        raise ConfigError(field, value, "True or False")


def _number(field: str, value: Any, low: float, high: float) -> float:
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not low <= float(value) <= high:
        raise ConfigError(field, value, f"a number from {low:g} to {high:g}")
    return float(value)


def _residual_scale(value: Any) -> tuple[float, float, float]:
    low, high = RESIDUAL_RANGE
    try:
        x, y, z = (_number("residual_scale", item, low, high) for item in value)
    except (TypeError, ValueError):
        allowed = f"three numbers from {low:g} to {high:g} m: forward, lateral, vertical"
        raise ConfigError("residual_scale", value, allowed) from None
    return x, y, z


def _is_multiple(value: float, unit: float) -> bool:
    ratio = value / unit
    return math.isclose(ratio, round(ratio), rel_tol=1e-9) and round(ratio) >= 1
