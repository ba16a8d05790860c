"""Plans and jumps as CSV: what is read back is what was written."""

import dataclasses

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env, planned, run_episode, traced
from icub_jump_env.export.tables import WORLD, read_table, write_jump, write_plan
from icub_jump_env.snapshot import Snapshot


def test_a_jump_comes_back_to_the_bit(tmp_path):
    config = traced(JumpConfig.of(controller="torque", stand_time=0.1))
    env = make_env(config)
    trace = run_episode(env, 0, trace=True).trace
    write_jump(trace, env.robot, tmp_path / "jump.csv")
    columns = read_table(tmp_path / "jump.csv")
    assert columns["phase"] == [snapshot.phase for snapshot in trace]
    for field in dataclasses.fields(Snapshot):
        values = [getattr(snapshot, field.name) for snapshot in trace]
        if isinstance(values[0], np.ndarray):
            parts = WORLD if len(values[0]) == 3 else env.robot.joint_names
            read = np.transpose([columns[f"{field.name}.{part}"] for part in parts])
            np.testing.assert_array_equal(read, values)
        else:
            assert columns[field.name] == values


def test_a_plan_comes_back_to_the_bit(tmp_path):
    config = JumpConfig(planner="whole_body", jump_height=0.05)
    plan = planned(config)
    write_plan(plan, config.robot_value, 200.0, tmp_path / "plan.csv")
    columns = read_table(tmp_path / "plan.csv")
    assert columns["time"][:2] == [0.0, 0.005]
    assert columns["time"][-1] == plan.duration
    for row in (0, 40, -1):
        setpoint = plan.sample(columns["time"][row])
        for part, value in zip(config.robot_value.joint_names, setpoint.posture, strict=True):
            assert columns[f"posture.{part}"][row] == value
        for part, value in zip(WORLD, setpoint.com_velocity, strict=True):
            assert columns[f"com_velocity.{part}"][row] == value
