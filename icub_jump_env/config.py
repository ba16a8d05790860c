"""The configuration of a jump: one frozen, validated dataclass."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self, TypeVar, get_args, get_type_hints

import numpy as np

from icub_jump_env.checks import (
    check_choice,
    check_count,
    check_flag,
    check_number,
    check_numbers,
    check_range,
    is_multiple,
)
from icub_jump_env.control.solvers import SolverName
from icub_jump_env.errors import ConfigError
from icub_jump_env.reference.com_trajectory import (
    MAX_DISPLACEMENT,
    ComScaling,
    plan_com_trajectory,
)
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig, ActuatorName
from icub_jump_env.simulation.randomization import (
    RANDOMIZATIONS,
    Randomization,
    RandomizationName,
)
from icub_jump_env.simulation.sensor_models import (
    MAX_DELAY,
    SENSORS,
    SensorConfig,
    SensorName,
)

T = TypeVar("T")

ControllerName = Literal["velocity", "torque"]
ResidualPhases = Literal["launch", "all"]
RenderMode = Literal["rgb_array", "human"]

CONTROL_RATES: dict[ControllerName, float] = {"velocity": 200.0, "torque": 500.0}
"""Default rate (Hz) of each controller."""

JUMP_HEIGHT_RANGE = (0.01, 0.15)
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
        jump_height: Commanded rise of the CoM in flight (m); lowest and highest, if each
            episode draws its own.
        com_displacement: Rise of the CoM in the launching phase (m); by default the
            paper's 0.11 with scaling by displacement.
        com_scaling: What fixes the duration of the launch: the CoM displacement, or a
            final CoM acceleration of -9.81 m/s^2.
        momentum_control: Pose the constraint on the angular momentum (eq. 3d).
        solver: QP solver.
        residual_scale: Largest offset of the CoM reference that an action can ask for:
            forward, lateral, vertical (m).
        residual_phases: When the residual acts: in the launch alone, where it moves the CoM
            reference, or in all phases; in flight and landing it moves the posture, as far as
            it takes to shift the CoM over resting feet.
        timestep: Physics step (s).
        control_frequency: Rate of the controller (Hz), a divisor of the physics rate; by
            default 200 for the velocity controller and 500 for the torque controller.
        agent_frequency: Rate of ``env.step`` (Hz), a divisor of the control rate.
        actuators: Model of servos, low-level torque control and motors: a name or an
            ``ActuatorConfig``.
        sensors: Errors of the sensors: a name or a ``SensorConfig``.
        command_delay: Control ticks until a command takes effect (computation time).
        randomization: What varies from episode to episode: a name or a
            ``Randomization``.
        stand_time: How long the robot must stand after touch-down (s).
        ankle_shift: Move the ankle pitch range by -15 deg, as the paper did.
        render_mode: None, rgb_array or human.

    Raises:
        ConfigError: If a field is out of range, naming the field, the value and the
            allowed range.
    """

    controller: ControllerName = "velocity"
    jump_height: float | tuple[float, float] = 0.04
    com_displacement: float | None = None
    com_scaling: ComScaling = "displacement"
    momentum_control: bool = True
    solver: SolverName = "daqp"
    residual_scale: tuple[float, float, float] = (0.06, 0.02, 0.02)
    residual_phases: ResidualPhases = "launch"
    timestep: float = 0.001
    control_frequency: float | None = None
    agent_frequency: float = 100.0
    actuators: ActuatorName | ActuatorConfig = "ideal"
    sensors: SensorName | SensorConfig = "ideal"
    command_delay: int = 0
    randomization: RandomizationName | Randomization = "none"
    stand_time: float = 2.0
    ankle_shift: bool = True
    render_mode: RenderMode | None = None

    def __post_init__(self) -> None:
        check_choice("controller", self.controller, get_args(ControllerName))
        check_choice("com_scaling", self.com_scaling, get_args(ComScaling))
        check_choice("residual_phases", self.residual_phases, get_args(ResidualPhases))
        check_choice("solver", self.solver, get_args(SolverName))
        check_choice("render_mode", self.render_mode, (None, *get_args(RenderMode)))
        for field in ("momentum_control", "ankle_shift"):
            self._store(field, check_flag(field, getattr(self, field)))
        self._store("jump_height", _check_heights(self.jump_height))
        if self.com_displacement is not None:
            self._store(
                "com_displacement",
                check_number("com_displacement", self.com_displacement, *DISPLACEMENT_RANGE),
            )
        self._store(
            "residual_scale",
            check_numbers("residual_scale", self.residual_scale, 3, *RESIDUAL_RANGE),
        )
        self._store("timestep", check_number("timestep", self.timestep, *TIMESTEP_RANGE))
        self._store("stand_time", check_number("stand_time", self.stand_time, *STAND_TIME_RANGE))
        self._check_models()
        self._check_rates()
        for height in self.jump_heights:
            plan_com_trajectory(height, self.com_displacement, self.com_scaling)

    def _store(self, field: str, value: Any) -> None:
        object.__setattr__(self, field, value)

    def _check_models(self) -> None:
        for field, names, kind in (
            ("actuators", ACTUATORS, ActuatorConfig),
            ("sensors", SENSORS, SensorConfig),
            ("randomization", RANDOMIZATIONS, Randomization),
        ):
            value = getattr(self, field)
            if isinstance(value, Mapping):
                self._store(field, _from_mapping(field, value, kind))
            elif not isinstance(value, kind):
                check_choice(field, value, tuple(names))
        self._store(
            "command_delay", check_count("command_delay", self.command_delay, 0, MAX_DELAY)
        )

    def _check_rates(self) -> None:
        physics = 1.0 / self.timestep
        if self.control_frequency is not None:
            frequency = check_number("control_frequency", self.control_frequency, 1.0, physics)
            self._store("control_frequency", frequency)
        control = self.control_rate
        if not is_multiple(physics, control):
            if self.control_frequency is None:
                raise ConfigError(
                    "timestep", self.timestep, f"a fraction of the control period, 1/{control:g} s"
                )
            raise ConfigError(
                "control_frequency", control, f"a divisor of the physics rate of {physics:g} Hz"
            )
        agent = check_number("agent_frequency", self.agent_frequency, *AGENT_FREQUENCY_RANGE)
        if not is_multiple(control, agent):
            raise ConfigError(
                "agent_frequency", agent, f"a divisor of the control rate of {control:g} Hz"
            )
        self._store("agent_frequency", agent)

    @property
    def jump_heights(self) -> tuple[float, float]:
        """Lowest and highest command (m)."""
        heights = self.jump_height
        return heights if isinstance(heights, tuple) else (heights, heights)

    @property
    def commanded_height(self) -> float:
        """The command (m), where there is only one.

        Raises:
            ConfigError: If each episode draws its own.
        """
        if isinstance(self.jump_height, tuple):
            raise ConfigError("jump_height", self.jump_height, "a single height here")
        return self.jump_height

    def draw_height(self, rng: np.random.Generator) -> float:
        """The command (m) of an episode."""
        if not isinstance(self.jump_height, tuple):
            return self.jump_height
        # A stream of its own: a given command finds the same world as the same one drawn.
        return rng.spawn(1)[0].uniform(*self.jump_height)

    @property
    def actuator_config(self) -> ActuatorConfig:
        """The actuator models, by name or as given."""
        return ACTUATORS[self.actuators] if isinstance(self.actuators, str) else self.actuators

    @property
    def sensor_config(self) -> SensorConfig:
        """The sensor errors, by name or as given."""
        return SENSORS[self.sensors] if isinstance(self.sensors, str) else self.sensors

    @property
    def randomization_config(self) -> Randomization:
        """The ranges, by name or as given."""
        ranges = self.randomization
        return RANDOMIZATIONS[ranges] if isinstance(ranges, str) else ranges

    @property
    def control_rate(self) -> float:
        """Rate of the controller (Hz)."""
        if self.control_frequency is None:
            return CONTROL_RATES[self.controller]
        return self.control_frequency

    @property
    def control_dt(self) -> float:
        """Control period T_s (s)."""
        return 1.0 / self.control_rate

    @property
    def physics_per_control(self) -> int:
        """Physics steps per control tick."""
        return round(self.control_dt / self.timestep)

    @property
    def controls_per_step(self) -> int:
        """Control ticks per ``env.step``."""
        return round(self.control_rate / self.agent_frequency)

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


def _check_heights(heights: Any) -> float | tuple[float, float]:
    if isinstance(heights, list | tuple | np.ndarray):
        return check_range("jump_height", heights, *JUMP_HEIGHT_RANGE)
    return check_number("jump_height", heights, *JUMP_HEIGHT_RANGE)


def _from_mapping(name: str, values: Mapping[str, Any], kind: type[T]) -> T:
    """A ``kind`` from a plain mapping, such as a configuration that was saved as JSON.

    Fields that are dataclasses themselves are mappings, too; where there are several to
    choose from, their ``kind`` says which.
    """
    hints = get_type_hints(kind)
    made = {}
    for key, value in values.items():
        if key not in hints:
            allowed = f"no such field; the fields of {name} are {', '.join(hints)}"
            raise ConfigError(str(key), value, allowed)
        options = [t for t in (hints[key], *get_args(hints[key])) if dataclasses.is_dataclass(t)]
        if options and isinstance(value, Mapping):
            value = _from_mapping(key, value, _choose(key, value, options))
        made[key] = value
    return kind(**made)


def _choose(name: str, values: Mapping[str, Any], options: list[Any]) -> Any:
    if len(options) == 1:
        return options[0]
    by_kind = {option.kind: option for option in options}
    kind = values.get("kind")
    check_choice(f"{name}.kind", kind, tuple(by_kind))
    return by_kind[kind]
