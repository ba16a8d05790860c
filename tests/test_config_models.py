"""Actuators, sensors and worlds in a configuration: by name, from JSON, and refused in words."""

import dataclasses
import json

import numpy as np
import pytest

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl
from icub_jump_env.simulation.randomization import RANDOMIZATIONS, Randomization
from icub_jump_env.simulation.sensor_models import SENSORS, SensorConfig, SensorError


def test_models_come_back_from_json():
    config = JumpConfig.of(
        actuators=ActuatorConfig(torque_loop=CurrentControl(100.0), motor=DCMotor(0.9)),
        sensors=SensorConfig(gyro=SensorError(noise=0.1), delay=1),
        randomization=Randomization(friction=(0.4, 1)),
    )
    saved = json.loads(json.dumps(dataclasses.asdict(config)))
    assert JumpConfig.of(**saved) == config


def test_names_stand_for_models():
    config = JumpConfig.of(actuators="realistic", sensors="realistic", randomization="mild")
    assert config.actuator_config == ACTUATORS["realistic"]
    assert config.sensor_config == SENSORS["realistic"]
    assert config.randomization_config == RANDOMIZATIONS["mild"]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("actuators", "magic"), ("actuators", 3), ("actuators", DCMotor()), ("sensors", None),
        ("randomization", "extreme"), ("command_delay", -1), ("command_delay", 1.5),
        ("command_delay", True), ("command_delay", 10**30),
    ],
)  # fmt: skip
def test_bad_models_are_refused(field, value):
    with pytest.raises(ConfigError) as refusal:
        JumpConfig.of(**{field: value})
    assert refusal.value.field == field


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("actuators", {"wings": 1}, ("wings", "no such field", "torque_loop")),
        ("actuators", {"torque_loop": {"kind": "magic"}}, ("torque_loop.kind", "'current'")),
        ("actuators", {"torque_loop": {"bandwidth": 20.0}}, ("torque_loop.kind", "None")),
        ("actuators", {"motor": {"kind": "dc", "current_limit": 1.2}}, ("current_limit", "1.2", "0.01 to 1")),
        ("actuators", {"torque_loop": {"kind": "feedback", "bandwidth": 2000}}, ("bandwidth=2000", "0.1 to 1000")),
        ("actuators", {"torque_loop": {"kind": "feedback", "current_limit": 1}}, ("current_limit", "no such field")),
        ("actuators", {"servo": 3}, ("servo=3", "ServoGains")),
        ("sensors", {"gyro": {"nose": 1.0}}, ("nose", "noise")),
        ("sensors", {"gyro": 0.1}, ("gyro=0.1", "SensorError")),
        ("sensors", {"delay": 10**30}, ("delay", "0 to 100")),
        ("randomization", {"friction": [0.4]}, ("friction", "2 numbers")),
        ("randomization", {"friction": "low"}, ("friction", "'low'")),
        ("randomization", {"friction": {0.4, 0.5}}, ("friction", "2 numbers")),
        ("randomization", {"friction": np.array(0.5)}, ("friction", "2 numbers")),
        ("randomization", {"friction": [1.0, 0.4]}, ("friction", "lower bound first")),
        ("randomization", {3: [1.0, 0.4]}, ("3", "no such field")),
    ],
)  # fmt: skip
def test_a_bad_value_inside_a_model_names_its_field_and_range(field, value, words):
    with pytest.raises(ConfigError) as refusal:
        JumpConfig.of(**{field: value})
    for word in words:
        assert word in str(refusal.value)


def test_numpy_values_become_plain():
    config = JumpConfig.of(
        sensors={"delay": np.int64(1), "gyro": {"noise": np.float32(0.5)}},
        randomization={"friction": np.array([0.4, 0.5])},
        actuators={"friction": np.float64(0.05), "servo": {"stiffness": np.int32(1000)}},
    )
    assert json.loads(json.dumps(dataclasses.asdict(config)))["sensors"]["delay"] == 1
    make_env(config).reset(seed=0)
