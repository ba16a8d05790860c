"""Playing back a table of actions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from policies import make_replay

from icub_jump_env import observation
from icub_jump_env.errors import ConfigError
from icub_jump_env.policy import ReplayPolicy
from icub_jump_env.policy.replay import MAX_COMMANDS, MAX_STEPS


def observe(time, height):
    """An observation in which everything but time and command is one."""
    values = {block.name: np.ones(len(block.labels)) for block in observation.BLOCKS}
    return observation.DEFAULT.encode(
        values | {"time": time, "jump_height": height}, observation.Memory()
    )


@pytest.mark.parametrize("frequency", [10.0, 100.0, 500.0])
def test_rows_by_the_time(frequency):
    table = make_replay(1, 40, frequency)
    for step in range(60):
        for lag in (-0.4, 0.0, 0.4):
            time = max(0.0, step + lag) / frequency
            expected = table.actions[0, min(step, 39)]
            assert table(observe(time, 0.05)).tobytes() == expected.tobytes()


@pytest.mark.parametrize("start", [0.01, 0.03])
def test_commands_of_the_table_get_their_own_actions(start):
    heights = np.round(np.arange(start, 0.15, 0.005), 3)
    actions = make_replay(len(heights), 2).actions
    table = ReplayPolicy(heights.astype(np.float32), actions, 100.0)
    for own, height in zip(actions, heights, strict=True):
        assert table(observe(0.01, height)).tobytes() == own[1].tobytes()


@given(height=st.floats(0.0, 0.2), step=st.integers(0, 6))
def test_interpolation_between_commands(height, step):
    table = make_replay()
    row = min(step, 4)
    expected = [
        np.interp(height, table.commands, table.actions[:, row, axis]) for axis in range(3)
    ]
    action = table(observe(step / 100, height))
    assert action.dtype == np.float32
    assert action == pytest.approx(expected, abs=2e-4)
    assert (np.abs(action) <= 1.0).all()


def test_beyond_the_table_the_nearest_command_holds():
    table = make_replay()
    assert table(observe(0.0, 0.01)).tobytes() == table.actions[0, 0].tobytes()
    assert table(observe(0.0, 0.15)).tobytes() == table.actions[-1, 0].tobytes()


@given(share=st.floats(0.0, 1.0) | st.floats(0.999, 1.0), low=st.floats(-1.0, 1.0, width=32))
def test_rounding_does_not_lead_out_of_the_box(share, low):
    commands = np.float32([0.02, 0.08])
    actions = np.array([[[low, -low, 1.0]], [[1.0, -1.0, 1.0]]], np.float32)
    action = ReplayPolicy(commands, actions, 100.0)(observe(0.0, 0.02 + 0.06 * share))
    assert (np.abs(action) <= 1.0).all()
    assert action[2] == 1.0


def test_times_before_the_start_mean_the_first_row():
    table = make_replay(1)
    assert table(observe(-0.5, 0.05)).tobytes() == table.actions[0, 0].tobytes()


def test_the_table_cannot_be_written_through_an_action():
    table = make_replay()
    before = table.actions.copy()
    table(observe(0.0, 0.02))[:] = 7.0
    assert (table.actions == before).all()


COMMANDS, ACTIONS = np.float32([0.02, 0.04]), np.zeros((2, 5, 3), np.float32)


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("commands", {"commands": [0.02, 0.04]}),
        ("commands", {"commands": np.float64([0.02, 0.04])}),
        ("commands", {"commands": np.float32([[0.02, 0.04]])}),
        ("commands", {"commands": np.float32([0.04, 0.02])}),
        ("commands", {"commands": np.float32([0.02, 0.02])}),
        ("commands", {"commands": np.float32([0.02, np.nan])}),
        ("commands", {"commands": np.float32([0.02, 4.0])}),
        ("number of commands", {"commands": np.float32([])}),
        ("number of commands", {"commands": np.zeros(MAX_COMMANDS + 1, np.float32)}),
        ("actions", {"actions": [[[0.0] * 3]]}),
        ("actions", {"actions": np.zeros((2, 5, 3))}),
        ("actions", {"actions": np.zeros((5, 2, 3), np.float32)}),
        ("actions", {"actions": np.zeros((2, 5, 4), np.float32)}),
        ("actions", {"actions": np.full((2, 5, 3), np.nan, np.float32)}),
        ("actions", {"actions": np.full((2, 5, 3), 1.001, np.float32)}),
        ("number of steps", {"actions": np.zeros((2, 0, 3), np.float32)}),
        ("number of steps", {"actions": np.zeros((2, MAX_STEPS + 1, 3), np.float32)}),
        ("agent_frequency", {"agent_frequency": 0.0}),
        ("agent_frequency", {"agent_frequency": "100"}),
    ],
)
def test_refusals_name_the_field(field, change):
    values = {"commands": COMMANDS, "actions": ACTIONS, "agent_frequency": 100.0}
    ReplayPolicy(**values)
    with pytest.raises(ConfigError) as error:
        ReplayPolicy(**(values | change))
    assert error.value.field == field
