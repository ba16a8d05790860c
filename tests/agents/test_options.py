"""What train.py can be asked for, on the command line and in files."""

import json
from pathlib import Path

import pytest
from tiny_run import UNUSUAL

import agents
from agents.options import TASK, PPOOptions, TrainOptions, read_options
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import TorqueConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.report.output import write_json
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.residual import ResidualConfig
from icub_jump_env.robot.icub import JOINT_NAMES
from icub_jump_env.shortcuts import Shortcuts
from icub_jump_env.versions import VERSIONS


@pytest.mark.parametrize("options", [TrainOptions(), UNUSUAL], ids=["default", "unusual"])
def test_options_survive_a_file(tmp_path, options):
    file = tmp_path / "options.json"
    write_json(file, options.as_dict())
    assert read_options(file) == options


def test_a_file_says_what_it_wants_and_the_task_the_rest(tmp_path):
    file = tmp_path / "options.json"
    file.write_text('{"env": {"controller": "torque"}, "ppo": {"epochs": 3}, "seed": 4}')
    assert read_options(file) == TrainOptions(
        env=TASK.replace(controller="torque"), ppo=PPOOptions(epochs=3), seed=4
    )


def test_a_file_without_groups_is_read(tmp_path):
    """As files were before the configuration had groups."""
    env = {
        "jump_height": [0.04, 0.08], "com_displacement": 0.1, "controller": "torque",
        "momentum_control": False, "solver": "osqp", "residual_scale": [0.05, 0.0, 0.01],
        "residual_phases": "all", "control_frequency": None, "agent_frequency": 50.0,
        "ankle_shift": True, "randomization": "full", "stand_time": 0.5, "render_mode": None,
    }  # fmt: skip
    file = tmp_path / "options.json"
    file.write_text(json.dumps({"env": env, "seed": 4}))
    found = read_options(file)
    assert found == TrainOptions(env=TASK.replace(**env), seed=4)
    assert found.env.residual == ResidualConfig((0.05, 0.0, 0.01), "all")
    assert found.env.success.stand_time == 0.5
    assert found.env.controller == TorqueConfig(momentum_control=False, solver="osqp")


def test_shortcuts_end_up_in_the_jump():
    found = TrainOptions(shortcuts=Shortcuts(solver="osqp", stand_time=0.5))
    assert found == TrainOptions(env=TASK.replace(solver="osqp", stand_time=0.5))
    assert found.env.controller_config.solver == "osqp"
    assert found.env.randomization == TASK.randomization
    assert "shortcuts" not in found.as_dict()


CONTENTS = {
    "nothing": ("", "config='options.json' is not allowed: expected a JSON file"),
    "not text": (b"\xff\x00\xfe", "config='options.json' is not allowed: expected a JSON file"),
    "nested": ("[" * 200_000, "config='options.json' is not allowed: expected a JSON file"),
    "a list": ("[1, 2]", "config='options.json' is not allowed: expected a JSON object"),
    "unknown": ('{"wings": 2}', "wings=2 is not allowed: no such field; the fields of config are"),
    "unknown below": ('{"ppo": {"wings": 2}}', "wings=2 is not allowed: no such field; the field"),
    "unknown jump": ('{"env": {"wings": 2}}', "wings=2 is not allowed: no such field; the fields"),
    "a folder": ('{"resume": "x"}', "resume='x' is not allowed: no such field"),
    "no mapping": ('{"env": 3}', "env=3 is not allowed: expected a JSON object"),
    "null": (
        '{"timesteps": null}',
        "timesteps=None is not allowed: expected a whole number from 1",
    ),
    "a fraction": ('{"seed": 0.5}', "seed=0.5 is not allowed: expected a whole number from 0"),
    "not a number": (
        '{"ppo": {"gamma": NaN}}',
        "gamma=nan is not allowed: expected a number from 0 to 1",
    ),
    "ragged": (
        '{"env": {"jump_height": [[1], [2, 3]]}}',
        "jump_height=[[1], [2, 3]] is not allow",
    ),
    "a mapping": ('{"axes": {"forward": 1}}', "axes={'forward': 1} is not allowed"),
    "a model": ('{"env": {"actuators": {"motor": 3}}}', "motor=3 is not allowed"),
}


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.fault("hostile options")
def test_another_file_is_refused(tmp_path, content):
    text, message = CONTENTS[content]
    file = tmp_path / "options.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError) as refusal:
        read_options(file)
    assert str(file) in str(refusal.value)
    assert message in str(refusal.value).replace(f"{tmp_path}/", "")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"config='.*none' is not allowed: .*No such file"):
        read_options(tmp_path / "none")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"inputs": "some"},
            "inputs='some' is not allowed: expected one of 'all', 'balance', 'command'",
        ),
        ({"axes": ("vertical", "forward")}, "in this order"),
        (
            {"timesteps": 0},
            "timesteps=0 is not allowed: expected a whole number from 1 to 1000000000",
        ),
        (
            {"seed": 2**32},
            "seed=4294967296 is not allowed: expected a whole number from 0 to 4294967295",
        ),
        ({"jobs": 0}, "jobs=0 is not allowed: expected a whole number from 1 to 1000"),
        (
            {"checkpoint_every": 0},
            "checkpoint_every=0 is not allowed: expected a whole number from 1",
        ),
        ({"jobs": 7}, "jobs=7 is not allowed: expected a divisor of ppo.episodes=64"),
        (
            {"env": JumpConfig.of(render_mode="rgb_array")},
            "render_mode='rgb_array' is not allowed",
        ),
        ({"env": JumpConfig(jumps=2)}, "jumps=2 is not allowed: expected 1 in a training"),
    ],
)
def test_a_value_out_of_range_is_refused(changes, message):
    with pytest.raises(ConfigError) as refusal:
        TrainOptions(**changes)
    assert message in str(refusal.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("episodes", 1),
        ("batch_size", 1),
        ("epochs", 0),
        ("learning_rate", 0.0),
        ("gamma", 1.1),
        ("gae_lambda", -0.1),
        ("clip_range", 0.0),
        ("target_kl", float("inf")),
        ("hidden", (8, 0)),
        ("hidden", (513,)),
        ("log_std", (-1.0,)),
        ("log_std", (-1.0, 3.0)),
        ("warmup", -1),
        ("ramp", 1.5),
        ("action_scale", 0.0),
        ("action_scale", 1.1),
    ],
)
def test_a_setting_of_ppo_out_of_range_is_refused(name, value):
    with pytest.raises(ConfigError, match=f"^{name}=.* is not allowed: .*"):
        PPOOptions(**{name: value})


def test_a_plan_sees_the_command_and_the_time_alone():
    entries = tuple(DEFAULT.scales)
    assert TrainOptions().input_names == entries
    assert TrainOptions(inputs="command").input_names == (
        *("phase.launch", "phase.flight", "phase.landing", "launch_progress", "time"),
        *("jump_height", "com_displacement", "takeoff_time"),
    )


def test_who_balances_sees_all_but_the_joints_of_now_and_before():
    env = TASK.replace(observation={"history": 2})
    seen = TrainOptions(env=env, inputs="balance").input_names
    assert {"gravity.x", "gravity@2.x", "foot_force.left"} < set(seen)
    unseen = [name for name in env.layout.scales if name not in seen]
    assert len(unseen) == 2 * len(JOINT_NAMES)
    assert all(name.startswith("joint_") for name in unseen)


def test_the_task_of_disturbed_worlds_is_a_jump_of_v1():
    options = read_options(Path(agents.__file__).parent / "hyperparameters" / "disturbed.json")
    jump = JumpConfig.of(
        **VERSIONS["ICubJump-v1"],
        jump_height=(0.04, 0.06),
        randomization="disturbed",
        residual_axes=options.axes,
        reward=options.env.reward,
    )
    assert options.env == jump


def test_the_default_folder_is_named_by_controller_and_seed():
    torque = TrainOptions(env=JumpConfig.of(controller="torque"), seed=3)
    assert str(torque.folder) == "runs/torque-seed3"
    assert json.dumps(torque.as_dict())  # paths are not in it
