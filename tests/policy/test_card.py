"""The card: JSON and back, refusals, and what must match."""

import contextlib
import dataclasses
import json
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from policies import DETAILS, POLICIES

from icub_jump_env import observation
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import PhaseConfig, VelocityConfig
from icub_jump_env.errors import ConfigError, PolicyMismatchError
from icub_jump_env.files import strict_json
from icub_jump_env.observation import ObservationConfig
from icub_jump_env.policy import PolicyCard, check_match
from icub_jump_env.policy.card import BEFORE_THERE_WAS_A_CHOICE, TASK_FIELDS, mismatches
from icub_jump_env.shortcuts import Shortcuts, path_to
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor
from icub_jump_env.simulation.actuators.servo import ServoGains
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl, TorqueFeedback
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.simulation.sensor_models import SensorConfig, SensorError


def make_card(**changes):
    policy = POLICIES["network"]
    values = {
        "kind": "network",
        "inputs": policy.inputs,
        "hidden": policy.hidden,
        "axes": policy.axes,
        "action_scale": policy.action_scale,
        "observation": tuple(observation.DEFAULT.scales.items()),
        **DETAILS,
    }
    return PolicyCard(**(values | changes))


def through_json(card):
    return PolicyCard.from_mapping(json.loads(strict_json(card.as_dict())))


CONFIGS = [
    JumpConfig(),
    JumpConfig.of(controller="torque", com_scaling="acceleration", momentum_control=False),
    JumpConfig.of(
        jump_height=(0.02, 0.08), residual_scale=(0.1, 0.0, 0.03), control_frequency=500
    ),
    JumpConfig.of(
        actuators="realistic", sensors="realistic", randomization="full", command_delay=2
    ),
    JumpConfig.of(actuators=ActuatorConfig(torque_loop=TorqueFeedback(12.0), motor=DCMotor(0.9))),
    JumpConfig.of(actuators=ActuatorConfig(ServoGains(), CurrentControl(), friction=0.03)),
    JumpConfig.of(
        sensors=SensorConfig(gyro=SensorError(noise=0.1), delay=3),
        randomization=Randomization(friction=(0.3, 0.9), delay=(0, 3), push=(-1, 1)),
    ),
]


@pytest.mark.parametrize("config", CONFIGS)
def test_any_configuration_comes_back(config):
    card = make_card(config=config)
    again = through_json(card)
    assert again == card
    assert again.config == config
    assert dataclasses.asdict(again.config) == dataclasses.asdict(config)
    assert make_card(config=dataclasses.asdict(config)) == card
    assert mismatches(again, config) == []


def test_the_content_is_plain():
    content = json.loads(strict_json(make_card(seed=None).as_dict()))
    assert content["format"] == 1
    assert content["inputs"] == ["gyro.y", "phase.launch", "time"]
    assert content["observation"][2] == ["phase.landing", 1.0]
    assert content["config"]["residual"]["scale"] == [0.06, 0.02, 0.02, 1.0, 1.5]
    assert content["results"] == {
        "success": {"full": 0.83, "interval": [0.77, 0.88]},
        "rise": None,
    }
    assert content["seed"] is content["sha256"] is None
    assert len(content) == len(dataclasses.fields(PolicyCard))


numbers = st.floats(-1e30, 1e30) | st.integers(-(10**9), 10**9)


@given(
    results=st.dictionaries(
        st.sampled_from(["success", "rise", "n"]),
        numbers | st.none() | st.lists(numbers, max_size=3),
    ),
    seed=st.none() | st.integers(0, 2**128),
    command=st.lists(st.text(max_size=20), max_size=4),
    scale=st.floats(1e-3, 1.0),
)
def test_free_fields_come_back(results, seed, command, scale):
    card = make_card(results=results, seed=seed, command=command, action_scale=scale)
    assert through_json(card) == card


def test_numpy_numbers_become_plain_ones():
    card = make_card(results={"rate": np.float32(0.5), "n": np.int64(3)}, seed=np.int64(4))
    assert through_json(card) == card


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("format", 2), ("format", "1"), ("format", True), ("format", None),
        ("kind", "recurrent"), ("kind", ["network"]), ("kind", None),
        ("inputs", ["speed"]), ("inputs", "time"), ("inputs", [["time"]]), ("inputs", None),
        ("hidden", [0]), ("hidden", [10**9]), ("hidden", [2.0]), ("hidden", 64),
        ("hidden", [8] * 5), ("hidden", [True]),
        ("axes", []), ("axes", ["lateral", "forward"]), ("axes", [None]), ("axes", {"up": 1}),
        ("action_scale", 0), ("action_scale", 1e400), ("action_scale", 10**400),
        ("observation", []), ("observation", {}), ("observation", [["time"]]),
        ("observation", [["time", 1.0], ["time", 1.0]]), ("observation", [[["time"], 1.0]]),
        ("observation", [["time", 1.0]] * 2000), ("observation", [["\n", 1.0]]),
        ("observation.time", [["time", 0.0]]), ("observation.time", [["time", "1"]]),
        ("config", []), ("config", None), ("config", "JumpConfig()"),
        ("jump_height", {"jump_height": [[1], [1, 2]]}), ("jump_height", {"jump_height": 9}),
        ("speed", {"speed": 1}), ("residual_scale", {"residual_scale": [0.1]}),
        ("kind", {"actuators": {"motor": {"kind": "dc"}, "torque_loop": {"kind": "feedback"},
                                "servo": {"kind": 1}}}),
        ("versions", []), ("versions.numpy", {"numpy": 2}), ("versions", {"": "1"}),
        ("versions.numpy", {"numpy": "2" * 1000}),
        ("command", "python train.py"), ("command", [1]), ("command", {}),
        ("seed", -1), ("seed", 1.0), ("seed", "0"),
        ("results", [0.5]), ("results", None), ("results.rate", {"rate": "high"}),
        ("results.rate", {"rate": float("nan")}), ("results.rate", {"rate": [True]}),
        ("results.a.b", {"a": {"b": float("inf")}}), ("results", {"\x1b[2J": 1.0}),
        ("sha256", "0" * 63), ("sha256", "X" * 64), ("sha256", 7), ("sha256", "0" * 64 + "\n"),
    ],
)  # fmt: skip
def test_refusals_name_the_field(field, value):
    content = json.loads(strict_json(make_card().as_dict()))
    key = field.split(".")[0]
    key = key if key in content and not (key == "kind" and isinstance(value, dict)) else "config"
    content[key] = value
    with pytest.raises(ConfigError) as error:
        PolicyCard.from_mapping(content)
    assert error.value.field == field


def test_fields_that_are_missing_or_unknown():
    content = json.loads(strict_json(make_card().as_dict()))
    for name in content:
        less = {key: value for key, value in content.items() if key != name}
        with pytest.raises(ConfigError, match=name):
            PolicyCard.from_mapping(less)
    with pytest.raises(ConfigError, match=r"weights=.* no such field; the fields are act"):
        PolicyCard.from_mapping(content | {"weights": "pickle"})


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=10,
)


@given(name=st.sampled_from([f.name for f in dataclasses.fields(PolicyCard)]), value=json_values)
@pytest.mark.fault("hostile policies")
def test_any_json_is_taken_or_refused_cleanly(name, value):
    content = json.loads(strict_json(make_card().as_dict())) | {name: value}
    with contextlib.suppress(ConfigError):
        assert through_json(card := PolicyCard.from_mapping(content)) == card


OTHERS = {
    "robot": "iCubGazeboV2_5",
    "residual_phases": "all",
    "residual_bandwidth": 20.0,
    "controller": "torque",
    "planner": "whole_body",
    "estimator": "imu",
    "lean_correction": True,
    "flight": "feedback",
    "landing": "feedback",
    "com_displacement": 0.1,
    "com_scaling": "acceleration",
    "momentum_control": False,
    "observation": ObservationConfig(cop=True),
    "residual_axes": ("forward", "vertical"),
    "residual_scale": (0.05, 0.02, 0.02, 1.0, 1.5),
    "control_frequency": 100.0,
    "agent_frequency": 50.0,
    "ankle_shift": False,
}


ALONE = ("com_scaling", "planner")
"""Those that exclude other differences."""


@pytest.mark.parametrize("field", TASK_FIELDS)
def test_each_field_of_the_task_must_match(field):
    card = make_card()
    needed = {"estimator": "imu"} if field in ("flight", "landing") else {}
    other = JumpConfig.of(**{field: OTHERS[field]}, **needed)
    found = mismatches(card, other)
    trained = JumpConfig().value_of(field)
    assert (field, trained, OTHERS[field]) in found
    # The default rate depends on the controller.
    assert {name.partition(".")[0] for name, _, _ in found} <= {
        field,
        "control_frequency",
        *needed,
    }
    with pytest.raises(PolicyMismatchError, match=field) as error:
        check_match(card, other)
    assert repr(trained) in str(error.value)
    assert repr(OTHERS[field]) in str(error.value)


def test_every_difference_is_named_in_one_line():
    differing = {name: OTHERS[name] for name in OTHERS if name not in ALONE}
    with pytest.raises(PolicyMismatchError) as error:
        check_match(make_card(), JumpConfig.of(**differing))
    message = str(error.value)
    assert "\n" not in message
    assert all(name in message for name in differing)
    assert not any(name in message for name in ALONE)
    again = pickle.loads(pickle.dumps(error.value))
    assert str(again) == message
    assert again.differences == error.value.differences


def test_the_rest_of_the_configuration_may_differ():
    config = JumpConfig.of(
        jump_height=(0.02, 0.06),
        solver="osqp",
        timestep=0.0005,
        actuators="realistic",
        sensors="realistic",
        command_delay=2,
        randomization="hard",
        stand_time=0.0,
        render_mode="rgb_array",
    )
    check_match(make_card(), config)
    check_match(make_card(), JumpConfig.of(control_frequency=200))


@pytest.mark.parametrize(
    ("controller", "field"),
    [
        (VelocityConfig(com=5.0), "controller.com"),
        (VelocityConfig(posture_weight=(1.0, 2.0, 3.0)), "controller.posture_weight"),
        (VelocityConfig(constraints="hard"), "controller.constraints"),
        (VelocityConfig(phases=PhaseConfig(launch_end="lift_off")), "controller.phases"),
    ],
)
def test_the_controller_must_be_the_one_of_the_training(controller, field):
    found = mismatches(make_card(), JumpConfig(controller=controller))
    assert [name for name, _, _ in found] == [field]
    check_match(make_card(), JumpConfig(controller=VelocityConfig(solver="osqp")))


def test_the_fields_are_sorted_into_two_kinds_with_none_forgotten():
    """A new field of the configuration must be sorted, too."""
    free = {
        "jump_height", "jumps", "plans", "solver", "timestep", "self_collision", "physics_loop",
        "actuators", "sensors", "command_delay", "randomization", "reward", "success", "stand_time", "early_end",
        "rendering", "render_mode", "width", "height", "camera", "residual",
    }  # fmt: skip
    of_the_controller = {"constraints", "launch_end"}
    names = {f.name for kind in (JumpConfig, Shortcuts) for f in dataclasses.fields(kind)}
    assert names == free | of_the_controller | set(TASK_FIELDS)


def test_axes_and_bandwidth_are_read_as_they_were_written():
    config = JumpConfig.of(residual_axes=("forward", "pitch"), residual_bandwidth=40.0)
    card = make_card(
        config=config, axes=("pitch",), observation=tuple(config.layout.scales.items())
    )
    assert through_json(card).config == config
    check_match(through_json(card), config)


def test_the_layout_must_match_by_name():
    entries = dict(observation.DEFAULT.scales)
    check_match(make_card(observation=tuple(reversed(entries.items()))), JumpConfig())
    del entries["foot_force.left"]
    changed = entries | {"gyro.y": 3.0, "wind": 1.0}
    card = make_card(observation=tuple(changed.items()))
    assert sorted(mismatches(card, JumpConfig()), key=lambda found: found[0]) == [
        ("observation.foot_force.left", None, 300.0),
        ("observation.gyro.y", 3.0, 2.0),
        ("observation.wind", 1.0, None),
    ]


@pytest.mark.parametrize(
    "field", [name for name in TASK_FIELDS if name not in BEFORE_THERE_WAS_A_CHOICE]
)
def test_a_card_says_every_field_that_the_policy_depends_on(field):
    content = make_card(config=JumpConfig.of(momentum_control=False)).as_dict()
    *groups, name = path_to(field)
    holder = content["config"]
    for group in groups:
        holder = holder[group]
    del holder[name]
    with pytest.raises(ConfigError, match=f"a configuration with {field}"):
        PolicyCard.from_mapping(content)


FLAT = {
    "jump_height": [0.04, 0.08], "com_displacement": 0.09, "com_scaling": "displacement",
    "controller": "torque", "momentum_control": False, "solver": "osqp",
    "residual_scale": [0.05, 0.02, 0.01], "residual_phases": "launch", "control_frequency": None,
    "agent_frequency": 50.0, "timestep": 0.001, "ankle_shift": True, "actuators": "realistic",
    "sensors": "realistic", "command_delay": 0, "randomization": "hard", "stand_time": 1.5,
    "render_mode": None,
}  # fmt: skip
"""As cards had it before the configuration had groups, and a choice of the robot."""


def test_a_card_without_groups_is_read_and_is_of_the_robot_there_was():
    card = make_card(config=FLAT)
    assert card.config == JumpConfig.of(**FLAT)
    assert card.config.residual.scale == (0.05, 0.02, 0.01, 1.0, 1.5)
    assert card.config.success.stand_time == 1.5
    assert not card.config.controller_config.momentum_control
    assert card.config.controller_config.solver == "osqp"
    assert card.config.robot == "iCubGenova04"
    assert card.config.residual.bandwidth == 15.0
    check_match(card, JumpConfig.of(**FLAT))
    with pytest.raises(PolicyMismatchError, match="robot='iCubGazeboV2_5' instead of"):
        check_match(card, JumpConfig.of(**FLAT, robot="iCubGazeboV2_5"))
    assert through_json(card) == card


@pytest.mark.parametrize("field", ["residual_scale", "residual_phases", "agent_frequency"])
def test_a_card_without_groups_says_every_field_too(field):
    less = {name: value for name, value in FLAT.items() if name != field}
    with pytest.raises(ConfigError, match=f"a configuration with {field}"):
        make_card(config=less)


def test_a_message_shows_no_more_than_the_beginning_of_a_long_value():
    with pytest.raises(ConfigError) as caught:
        PolicyCard.from_mapping(make_card().as_dict() | {"kind": "x" * 100_000})
    assert len(str(caught.value)) < 1200
    assert caught.value.value == "x" * 100_000
