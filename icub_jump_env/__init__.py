"""Humanoid jumping with the iCub: a Gymnasium environment around two QP controllers.

Importing this package registers ``ICubJump-v0``, the paper's jump, and ``ICubJump-v1``, which
plans with the whole body and controls flight and landing by feedback::

    import gymnasium, icub_jump_env

    env = gymnasium.make("ICubJump-v1", jump_height=0.06)
"""

from __future__ import annotations

import gymnasium

from icub_jump_env.config import VERSIONS, JumpConfig
from icub_jump_env.control.config import (
    ContactConfig,
    PhaseConfig,
    TorqueConfig,
    VelocityConfig,
)
from icub_jump_env.errors import (
    ActionError,
    CommandNotScalableError,
    ConfigError,
    ICubJumpError,
    InvalidValueError,
    MissingDependencyError,
    UnknownFieldError,
)
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.planning.residual import ResidualConfig
from icub_jump_env.reward import RewardConfig
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor, RatedMotor
from icub_jump_env.simulation.actuators.servo import ServoGains
from icub_jump_env.simulation.actuators.torque_loops import (
    CurrentControl,
    IdealTorque,
    TorqueFeedback,
)
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.simulation.render_config import RenderConfig
from icub_jump_env.simulation.sensor_models import SensorConfig, SensorError

__version__ = "0.1.0"

ENV_ID = "ICubJump-v0"

MAX_EPISODE_STEPS = 1_000_000
"""Guard only: every episode ends by itself."""

for _name, _defaults in VERSIONS.items():
    gymnasium.register(
        id=_name,
        entry_point="icub_jump_env.env:ICubJumpEnv",
        max_episode_steps=MAX_EPISODE_STEPS,
        kwargs=dict(_defaults),
    )

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
