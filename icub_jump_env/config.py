"""The configuration of a jump: one frozen, validated dataclass of groups."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Self, get_args

import numpy as np

from icub_jump_env.checks import (
    check_choice,
    check_count,
    check_flag,
    check_number,
    check_numbers,
    check_range,
    check_type,
    is_multiple,
    store,
)
from icub_jump_env.control.config import (
    CONTROLLERS,
    ControllerConfig,
    ControllerName,
    FlightName,
    LandingName,
    TorqueConfig,
    VelocityConfig,
)
from icub_jump_env.errors import ConfigError
from icub_jump_env.estimation.estimator import EstimatorName
from icub_jump_env.mappings import nested
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.observation import Layout, ObservationConfig
from icub_jump_env.planning.plan import Planner, PlannerName
from icub_jump_env.planning.residual import RESIDUAL_TIME, ResidualConfig
from icub_jump_env.planning.scaled_curve import (
    MAX_DISPLACEMENT,
    ComScaling,
    ScaledCurvePlanner,
    plan_com_trajectory,
)
from icub_jump_env.planning.whole_body.family import (
    PlanFamily,
    WholeBodyPlanner,
    family_of,
)
from icub_jump_env.reward import RewardConfig
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot, load_robot
from icub_jump_env.robot.urdf import DEFAULT_MODEL
from icub_jump_env.shortcuts import WithShortcuts
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig, ActuatorName
from icub_jump_env.simulation.randomization import (
    RANDOMIZATIONS,
    Randomization,
    RandomizationName,
)
from icub_jump_env.simulation.render_config import RenderConfig
from icub_jump_env.simulation.sensor_models import (
    MAX_DELAY,
    SENSORS,
    SensorConfig,
    SensorName,
)

PhysicsLoop = Literal["compiled", "python"]

JUMP_HEIGHT_RANGE = (0.01, 0.15)
MOST_JUMPS = 100
DISPLACEMENT_RANGE = (0.03, MAX_DISPLACEMENT)
TIMESTEP_RANGE = (1e-5, 2e-3)
AGENT_FREQUENCY_RANGE = (1.0, 1000.0)


@dataclass(frozen=True)
class JumpConfig(WithShortcuts):
    """What ``gymnasium.make("ICubJump-v0", ...)`` takes, beside the :class:`Shortcuts`.

    The defaults are those of v0; :data:`icub_jump_env.versions.VERSIONS` says which differ in v1.

    Attributes:
        robot: Model of the icub-models package.
        ankle_shift: Move the ankle pitch range by -15 deg, as the paper did.
        controller: Controller of the launching phase: a name, a ``VelocityConfig`` or a
            ``TorqueConfig``.
        jump_height: Commanded rise of the CoM in flight (m); lowest and highest, if each
            jump draws its own.
        jumps: Jumps of an episode, each from a new crouch.
        planner: What the launch follows: the paper's scaled CoM curve from a fixed crouch, or
            whole-body plans within the robot's limits.
        plans: File of whole-body plans; by default the family of the package.
        com_displacement: Rise of the CoM in the launching phase (m); by default the
            paper's 0.11 with scaling by displacement.
        com_scaling: What fixes the duration of the launch: the CoM displacement, or a
            final CoM acceleration of -9.81 m/s^2.
        estimator: Where the state comes from: the paper's assumption that the feet stand still,
            or the IMU as far as they do not.
        lean_correction: Correct the launch by the lean that the IMU feels as a jump begins.
        flight: Minimum jerk to the landing posture, or soles placed by feedback.
        landing: Hold the posture, or catch by feedback.
        residual: How actions move the reference.
        observation: What the observation has beside the default.
        agent_frequency: Rate of ``env.step`` (Hz), a divisor of the control rate.
        timestep: Physics step (s).
        self_collision: Let the robot's links touch each other.
        physics_loop: Whether the physics steps of a control tick are compiled, or call
            ``mujoco.mj_step`` from Python, where it can be patched. The same bits.
        actuators: Model of servos, low-level torque control and motors: a name or an
            ``ActuatorConfig``.
        sensors: Errors of the sensors: a name or a ``SensorConfig``.
        command_delay: Control ticks until a command takes effect (computation time).
        randomization: What varies from episode to episode: a name or a
            ``Randomization``.
        reward: Weights of the reward terms.
        success: What counts as a successful jump.
        rendering: Pictures.

    Raises:
        ConfigError: If a field is out of range, naming the field, the value and the
            allowed range.
    """

    robot: str = DEFAULT_MODEL
    ankle_shift: bool = True
    controller: ControllerName | VelocityConfig | TorqueConfig = "velocity"
    jump_height: float | tuple[float, float] = 0.04
    jumps: int = 1
    planner: PlannerName = "scaled_curve"
    plans: str | None = None
    com_displacement: float | None = None
    com_scaling: ComScaling = "displacement"
    estimator: EstimatorName = "feet_fixed"
    lean_correction: bool = False
    flight: FlightName = "minimum_jerk"
    landing: LandingName = "hold"
    residual: ResidualConfig = field(default_factory=ResidualConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    agent_frequency: float = 100.0
    timestep: float = 0.001
    self_collision: bool = False
    physics_loop: PhysicsLoop = "compiled"
    actuators: ActuatorName | ActuatorConfig = "ideal"
    sensors: SensorName | SensorConfig = "ideal"
    command_delay: int = 0
    randomization: RandomizationName | Randomization = "none"
    reward: RewardConfig = field(default_factory=RewardConfig)
    success: SuccessConfig = field(default_factory=SuccessConfig)
    rendering: RenderConfig = field(default_factory=RenderConfig)

    def __post_init__(self) -> None:
        for name in ("ankle_shift", "lean_correction", "self_collision"):
            store(self, **{name: check_flag(name, getattr(self, name))})
        check_type("robot", self.robot, str)
        load_robot(self.robot, self.ankle_shift)
        check_choice("com_scaling", self.com_scaling, get_args(ComScaling))
        check_choice("estimator", self.estimator, get_args(EstimatorName))
        check_choice("physics_loop", self.physics_loop, get_args(PhysicsLoop))
        for name, names in (("flight", FlightName), ("landing", LandingName)):
            check_choice(name, getattr(self, name), get_args(names))
            if getattr(self, name) == "feedback" and self.estimator != "imu":
                raise ConfigError(name, "feedback", "only with estimator='imu'")
        store(self, jump_height=_check_heights(self.jump_height))
        store(self, jumps=check_count("jumps", self.jumps, 1, MOST_JUMPS))
        if self.com_displacement is not None:
            displacement = check_number(
                "com_displacement", self.com_displacement, *DISPLACEMENT_RANGE, "m"
            )
            store(self, com_displacement=displacement)
        store(self, timestep=check_number("timestep", self.timestep, *TIMESTEP_RANGE, "s"))
        delay = check_count("command_delay", self.command_delay, 0, MAX_DELAY, "ticks")
        store(self, command_delay=delay)
        self._check_groups()
        self._check_rates()
        self._check_plan()

    def _check_plan(self) -> None:
        check_choice("planner", self.planner, get_args(PlannerName))
        if self.planner == "scaled_curve":
            if self.plans is not None:
                raise ConfigError("plans", self.plans, "None with planner='scaled_curve'")
            for height in self.jump_heights:
                plan_com_trajectory(height, self.com_displacement, self.com_scaling)
            return
        for name, value, allowed in (
            ("com_displacement", self.com_displacement, None),
            ("com_scaling", self.com_scaling, "displacement"),
            ("launch_end", self.controller_config.phases.launch_end, "time"),
            ("ankle_shift", self.ankle_shift, True),
        ):
            if value != allowed:
                raise ConfigError(name, value, f"{allowed!r} with planner='whole_body'")
        if self.plans is not None:
            check_type("plans", self.plans, str, Path)
            store(self, plans=str(self.plans))
        for height in self.jump_heights:
            self.plan_family.check_height(height)

    @property
    def plan_family(self) -> PlanFamily:
        """The whole-body plans.

        Raises:
            PlanFileError: If there are none of this robot and controller.
        """
        path = None if self.plans is None else Path(self.plans)
        return family_of(self.robot_value, self.controller_name, path)

    def make_planner(self, kinematics: FeetFixedKinematics) -> Planner:
        """What plans the jumps.

        Args:
            kinematics: The model of the robot; the planner updates it.
        """
        if self.planner == "whole_body":
            return WholeBodyPlanner(self.plan_family, kinematics)
        ballistic = self.controller_config.phases.launch_end == "lift_off"
        return ScaledCurvePlanner(kinematics, self.com_displacement, self.com_scaling, ballistic)

    def _check_groups(self) -> None:
        for name, presets, kind in (
            ("controller", CONTROLLERS, (VelocityConfig, TorqueConfig)),
            ("actuators", ACTUATORS, ActuatorConfig),
            ("sensors", SENSORS, SensorConfig),
            ("randomization", RANDOMIZATIONS, Randomization),
        ):
            value = self._from_mapping(name)
            if not isinstance(value, kind):
                check_choice(name, value, tuple(presets))
        for name, preset in CONTROLLERS.items():
            if self.controller == preset:
                store(self, controller=name)
        for name, group in (
            ("residual", ResidualConfig),
            ("observation", ObservationConfig),
            ("reward", RewardConfig),
            ("success", SuccessConfig),
            ("rendering", RenderConfig),
        ):
            check_type(name, self._from_mapping(name), group)

    def _from_mapping(self, name: str) -> Any:
        """A group, made of the plain mapping that a file has in its place."""
        value = getattr(self, name)
        if isinstance(value, Mapping):
            value = nested(name, value, JumpConfig)
            store(self, **{name: value})
        return value

    def _check_rates(self) -> None:
        physics, control = 1.0 / self.timestep, self.controller_config.frequency
        if not is_multiple(physics, control):
            if control == CONTROLLERS[self.controller_name].frequency:
                raise ConfigError(
                    "timestep", self.timestep, f"a fraction of the control period, 1/{control:g} s"
                )
            raise ConfigError(
                "control_frequency", control, f"a divisor of the physics rate of {physics:g} Hz"
            )
        agent = check_number("agent_frequency", self.agent_frequency, *AGENT_FREQUENCY_RANGE, "Hz")
        if not is_multiple(control, agent):
            raise ConfigError(
                "agent_frequency", agent, f"a divisor of the control rate of {control:g} Hz"
            )
        store(self, agent_frequency=agent)

    @property
    def jump_heights(self) -> tuple[float, float]:
        """Lowest and highest command (m)."""
        heights = self.jump_height
        return heights if isinstance(heights, tuple) else (heights, heights)

    @property
    def commanded_height(self) -> float:
        """The command (m), where there is only one.

        Raises:
            ConfigError: If each jump draws its own.
        """
        if isinstance(self.jump_height, tuple):
            raise ConfigError("jump_height", self.jump_height, "a single height here")
        return self.jump_height

    def draw_heights(self, rng: np.random.Generator) -> tuple[float, ...]:
        """The commands (m) of an episode's jumps."""
        if not isinstance(self.jump_height, tuple):
            return (self.jump_height,) * self.jumps
        # A stream of its own: a given command finds the same world as the same one drawn.
        own = rng.spawn(1)[0]
        return tuple(own.uniform(*self.jump_height) for _ in range(self.jumps))

    def foreseen_from(self, duration: float) -> float:
        """From when on the outcome of a jump that takes off at ``duration`` is foreseen (s)."""
        if not self.success.early_end:
            return math.inf
        return duration + RESIDUAL_TIME if self.residual.phases == "all" else duration

    @property
    def layout(self) -> Layout:
        """What each entry of the observation means."""
        return Layout(self.observation, self.residual.axes)

    @property
    def robot_value(self) -> Robot:
        """The robot."""
        return load_robot(self.robot, self.ankle_shift)

    @property
    def controller_config(self) -> VelocityConfig | TorqueConfig:
        """The controller, by name or as given."""
        given = self.controller
        return CONTROLLERS[given] if isinstance(given, str) else given

    @property
    def controller_name(self) -> ControllerName:
        """Name of the controller."""
        return self.controller_config.kind

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
    def control_dt(self) -> float:
        """Control period T_s (s)."""
        return 1.0 / self.controller_config.frequency

    @property
    def physics_per_control(self) -> int:
        """Physics steps per control tick."""
        return round(self.control_dt / self.timestep)

    @property
    def controls_per_step(self) -> int:
        """Control ticks per ``env.step``."""
        return round(self.controller_config.frequency / self.agent_frequency)

    def for_controller(self, name: ControllerName) -> Self:
        """The same jump with the other controller at its own gains and rate."""
        if name == self.controller_name:
            return self
        ours = self.controller_config
        controller = dataclasses.replace(
            CONTROLLERS[name],
            **{field.name: getattr(ours, field.name) for field in _COMMON_FIELDS},
        )
        return dataclasses.replace(self, controller=controller)

    def with_options(
        self, options: Mapping[str, Any] | None
    ) -> tuple[Self, tuple[float, ...] | None]:
        """One episode: ``reset(options={"jump_height": ...})``, or ``"jump_heights"`` of each jump.

        Returns:
            Its configuration, and the commands of its jumps (m) if they are given one by one.

        Raises:
            ConfigError: If an option is unknown or out of range.
        """
        allowed = "'jump_height' or 'jump_heights'"
        if options is None:
            return self, None
        if not isinstance(options, Mapping) or len(options) > 1:
            raise ConfigError("options", options, f"a mapping with the key {allowed}, or None")
        for name, value in options.items():
            if name == "jump_heights":
                heights = check_numbers(name, value, self.jumps, *JUMP_HEIGHT_RANGE, "m")
                for height in heights:
                    dataclasses.replace(self, jump_height=height)  # refuses what has no plan
                return self, heights
            if name != "jump_height":
                raise ConfigError(f"options[{name!r}]", value, f"no such option; say {allowed}")
        return dataclasses.replace(self, **options), None


_COMMON_FIELDS = [
    field for field in dataclasses.fields(ControllerConfig) if field.name != "frequency"
]


def _check_heights(heights: Any) -> float | tuple[float, float]:
    if isinstance(heights, list | tuple | np.ndarray):
        return check_range("jump_height", heights, *JUMP_HEIGHT_RANGE, "m")
    return check_number("jump_height", heights, *JUMP_HEIGHT_RANGE, "m")
