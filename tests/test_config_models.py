"""Groups of a configuration: by name, from JSON, by shortcut, and refused in words."""

import dataclasses
import json

import numpy as np
import pytest

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import (
    CONTROLLERS,
    ContactConfig,
    PhaseConfig,
    TorqueConfig,
    VelocityConfig,
)
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.planning.residual import ResidualConfig
from icub_jump_env.reward import RewardConfig
from icub_jump_env.shortcuts import Shortcuts
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl
from icub_jump_env.simulation.randomization import RANDOMIZATIONS, Randomization
from icub_jump_env.simulation.render_config import RenderConfig
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


ALL_DIFFERENT = JumpConfig(
    robot="iCubGenova02",
    ankle_shift=False,
    controller=TorqueConfig(
        frequency=250.0,
        solver="osqp",
        constraints="hard",
        momentum_control=False,
        phases=PhaseConfig(launch_end="lift_off", lift_off=5.0, touch_down=20.0, lift_off_ticks=3),
        com_stiffness=150.0,
        posture_weight=tuple(np.linspace(0.1, 2.0, 23)),
        smoothness_weight=(1e-3, 2e-3, 3e-3),
        contact=ContactConfig(friction=0.4),
    ),
    jump_height=(0.03, 0.05),
    com_displacement=0.1,
    lean_correction=True,
    residual=ResidualConfig(scale=(0.01, 0.02, 0.03), phases="all", bandwidth=20.0),
    agent_frequency=50.0,
    timestep=0.0005,
    actuators=ActuatorConfig(motor=DCMotor(0.9)),
    sensors="realistic",
    command_delay=1,
    randomization="hard",
    reward=RewardConfig(1.5, 2.5, 0.5, 0.01),
    success=SuccessConfig(0.05, 0.9, 1.0),
    rendering=RenderConfig("rgb_array", 320, 200, "front"),
)


class TestGroups:
    @pytest.mark.parametrize(
        "config",
        [
            JumpConfig(),
            ALL_DIFFERENT,
            ALL_DIFFERENT.replace(controller=VelocityConfig(limit_horizon=0.01)),
            JumpConfig(controller="torque", com_scaling="acceleration"),
        ],
        ids=["default", "different", "velocity", "torque"],
    )
    def test_json_and_back(self, config):
        plain = dataclasses.asdict(config)
        for given in (plain, json.loads(json.dumps(plain))):
            again = JumpConfig.of(**given)
            assert again == config
            assert hash(again) == hash(config)
            assert again.replace() == config

    @pytest.mark.parametrize("name", sorted(CONTROLLERS))
    def test_a_controller_that_equals_a_preset_goes_by_its_name(self, name):
        for given in (
            CONTROLLERS[name],
            dataclasses.replace(CONTROLLERS[name]),
            dataclasses.asdict(CONTROLLERS[name]),
            {"kind": name},
        ):
            config = JumpConfig(controller=given)
            assert config.controller == config.controller_name == name
            assert config == JumpConfig(controller=name)
            assert hash(config) == hash(JumpConfig(controller=name))
        assert config.replace(solver="osqp").controller != name
        assert config.replace(solver="osqp").replace(solver="daqp").controller == name
        assert config.replace(solver="osqp").controller_name == name

    @pytest.mark.parametrize(
        ("shortcut", "value", "group"),
        [
            ("solver", "osqp", {"controller": {"kind": "velocity", "solver": "osqp"}}),
            ("constraints", "hard", {"controller": {"kind": "velocity", "constraints": "hard"}}),
            ("momentum_control", False, {"controller": VelocityConfig(momentum_control=False)}),
            ("control_frequency", 100.0, {"controller": {"kind": "velocity", "frequency": 100.0}}),
            (
                "launch_end",
                "lift_off",
                {"controller": {"kind": "velocity", "phases": {"launch_end": "lift_off"}}},
            ),
            ("residual_axes", ("forward", "pitch"), {"residual": {"axes": ["forward", "pitch"]}}),
            ("residual_scale", (0.01, 0.02, 0.03), {"residual": {"scale": [0.01, 0.02, 0.03]}}),
            ("residual_bandwidth", 20.0, {"residual": ResidualConfig(bandwidth=20.0)}),
            ("residual_phases", "all", {"residual": ResidualConfig(phases="all")}),
            ("stand_time", 0.5, {"success": {"stand_time": 0.5}}),
            ("early_end", True, {"success": {"early_end": True}}),
            ("render_mode", "rgb_array", {"rendering": {"mode": "rgb_array"}}),
            ("width", 320, {"rendering": {"width": 320}}),
            ("height", 200, {"rendering": {"height": 200}}),
            ("camera", "front", {"rendering": {"camera": "front"}}),
        ],
    )
    def test_a_shortcut_sets_its_field_and_no_other(self, shortcut, value, group):
        config = JumpConfig.of(**{shortcut: value})
        assert config == JumpConfig(**group)
        assert config != JumpConfig()
        assert config.replace(**{shortcut: None}) == config
        # And in a group that is not the default one.
        different = ALL_DIFFERENT.replace(**{shortcut: value})
        changed = [
            name
            for name, now in dataclasses.asdict(different).items()
            if now != dataclasses.asdict(ALL_DIFFERENT)[name]
        ]
        assert changed in ([], [next(iter(group))])

    def test_the_test_above_has_all_shortcuts(self):
        mark = self.test_a_shortcut_sets_its_field_and_no_other.pytestmark[0]
        fields = [field.name for field in dataclasses.fields(Shortcuts)]
        assert [name for name, *_ in mark.args[1]] == fields

    def test_shortcuts_of_one_group_add_up_also_with_the_group_itself(self):
        config = JumpConfig.of(controller="torque", solver="osqp", momentum_control=False, launch_end="lift_off", stand_time=0.5, success={"height_ratio": 0.5}
        )  # fmt: skip
        assert config.controller == TorqueConfig(
            solver="osqp", momentum_control=False, phases=PhaseConfig(launch_end="lift_off")
        )
        assert config.success == SuccessConfig(stand_time=0.5, height_ratio=0.5)

    def test_the_other_controller_takes_what_both_have_and_keeps_its_own(self):
        ours = JumpConfig().replace(
            solver="osqp", constraints="hard", momentum_control=False, launch_end="lift_off"
        )
        assert ours.for_controller("velocity") is ours
        theirs = ours.for_controller("torque")
        assert theirs.controller == TorqueConfig(
            solver="osqp",
            constraints="hard",
            momentum_control=False,
            phases=PhaseConfig(launch_end="lift_off"),
        )
        assert theirs.controller_config.frequency == 500.0
        assert theirs.for_controller("velocity") == ours
        assert JumpConfig().for_controller("torque") == JumpConfig(controller="torque")
        assert dataclasses.replace(theirs, controller=ours.controller) == ours

    @pytest.mark.parametrize(
        ("given", "words"),
        [
            ({"controller": {"frequency": 100.0}}, ("controller.kind", "'velocity', 'torque'")),
            ({"controller": {"kind": "velocity", "com_stiffness": 1.0}}, ("com_stiffness", "com")),
            ({"controller": {"kind": "torque", "contact": {"mu": 1}}}, ("mu", "friction")),
            ({"controller": {"kind": "torque", "phases": {"lift_off": -1}}}, ("lift_off=-1",)),
            ({"controller": {"kind": "velocity", "posture_weight": 1.0}}, ("posture_weight",)),
        ],
    )
    def test_a_bad_controller_is_refused_in_words(self, given, words):
        with pytest.raises(ConfigError) as refusal:
            JumpConfig(**given)
        for word in words:
            assert word in str(refusal.value)

    def test_physics_and_control_rates(self):
        config = ALL_DIFFERENT
        assert config.control_dt == 1 / 250.0
        assert config.physics_per_control == 8
        assert config.controls_per_step == 5
