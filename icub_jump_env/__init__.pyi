"""The public names, and where they come from: each is imported when it is first used."""

from .config import JumpConfig
from .control.config import (
    ContactConfig,
    PhaseConfig,
    TorqueConfig,
    VelocityConfig,
)
from .errors import (
    ActionError,
    CommandNotScalableError,
    ConfigError,
    ICubJumpError,
    InvalidValueError,
    MissingDependencyError,
    UnknownFieldError,
)
from .metrics.jump import SuccessConfig
from .observation import ObservationConfig
from .planning.residual import ResidualConfig
from .reward import RewardConfig
from .simulation.actuators.config import ActuatorConfig
from .simulation.actuators.motors import DCMotor, RatedMotor
from .simulation.actuators.servo import ServoGains
from .simulation.actuators.torque_loops import (
    CurrentControl,
    IdealTorque,
    TorqueFeedback,
)
from .simulation.randomization import Randomization
from .simulation.render_config import RenderConfig
from .simulation.sensor_models import SensorConfig, SensorError
from .versions import ENV_ID

__version__: str

__all__ = [
    "ENV_ID",
    "ActionError",
    "ActuatorConfig",
    "CommandNotScalableError",
    "ConfigError",
    "ContactConfig",
    "CurrentControl",
    "DCMotor",
    "ICubJumpError",
    "IdealTorque",
    "InvalidValueError",
    "JumpConfig",
    "MissingDependencyError",
    "ObservationConfig",
    "PhaseConfig",
    "Randomization",
    "RatedMotor",
    "RenderConfig",
    "ResidualConfig",
    "RewardConfig",
    "SensorConfig",
    "SensorError",
    "ServoGains",
    "SuccessConfig",
    "TorqueConfig",
    "TorqueFeedback",
    "UnknownFieldError",
    "VelocityConfig",
]
