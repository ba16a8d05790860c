"""The estimators against the truth: what is measured, and what the command prints."""

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from experiments import estimators
from experiments.estimation_errors import (
    ESTIMATORS,
    PHASES,
    QUANTITIES,
    Comparison,
    Motion,
    phases_of,
)
from experiments.estimators import EstimatorOptions, Row, conclusions, render, run
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot


def test_errors_are_those_of_each_quantity():
    truth = Motion(np.eye(3), np.zeros(3), np.ones(3), np.zeros(3), np.zeros((2, 3)))

    def errors(**believed):
        return truth._replace(**believed).errors(truth)

    assert errors() == [0.0] * 4
    assert errors(angular_momentum=np.array([3.0, 4.0, 0.0])) == [0.0, 5.0, 0.0, 0.0]
    assert errors(com_velocity=np.array([0.0, 3.0, 4.0])) == [0.0, 0.0, 0.0, 5.0]
    moved = errors(com=truth.com + [0.03, 0.0, 0.0], soles=truth.soles - [0.0, 0.04, 0.0])
    assert moved == pytest.approx([0.0, 0.0, 5.0, 0.0])
    for turn, tilt in (([0.0, 0.0, 1.0], 0.0), ([0.3, 0.0, 0.0], 0.3), ([0.0, -2.0, 0.0], 2.0)):
        (found, *_) = errors(rotation=pin.exp3(np.array(turn)))
        assert found == pytest.approx(math.degrees(tilt), abs=1e-9)


def test_phases_follow_each_other():
    times = np.array([0.0, 0.369, 0.371, 0.399, 0.401, 0.599, 0.601, 0.899, 0.901])
    np.testing.assert_array_equal(phases_of(times, 0.4, 0.2), [0, 0, 1, 1, 2, 2, 3, 3, 4])
    np.testing.assert_array_equal(phases_of(times, 0.4, 0.0), [0, 0, 1, 1, 2, 2, 2, 2, 2])
    np.testing.assert_array_equal(phases_of(times, math.nan, 0.0), [0] * 9)


@pytest.fixture(scope="module")
def nominal():
    """Of a jump in the nominal world, (phases, estimators, quantities)."""
    return Comparison(JumpConfig.of(stand_time=0.4)).jump(0)


def test_in_the_launch_all_are_right_and_in_the_air_the_imu(nominal):
    attitude, momentum, com, velocity = np.moveaxis(nominal, 2, 0)
    launch, flight = PHASES.index("launch"), PHASES.index("flight")
    assert nominal.shape == (len(PHASES), len(ESTIMATORS), len(QUANTITIES))
    assert (nominal[launch] < [0.1, 0.02, 0.05, 0.02]).all()
    for error, imu, feet in ((attitude, 0.2, 2.0), (momentum, 0.1, 1.0), (com, 0.2, 2.0)):
        assert error[flight, 0] > feet
        assert (error[flight, 1:] < imu).all()
    assert (velocity[flight, 1:] < 0.03).all()
    assert velocity[flight, 0] > 0.3


def test_the_accelerometer_has_a_part_in_the_velocity_alone(nominal):
    others = nominal[:, 1:3, :3]
    np.testing.assert_allclose(others[:, 0], others[:, 1], rtol=1e-9)


def test_the_direction_of_gravity_has_a_part_in_flight_from_the_air_on(nominal):
    with_gravity, without = nominal[:, 1], nominal[:, 3]
    launch, flight = PHASES.index("launch"), PHASES.index("flight")
    np.testing.assert_array_equal(with_gravity[launch], without[launch])
    assert 0.0 < abs(with_gravity[flight, 0] - without[flight, 0]) < 0.1


def test_without_gravity_in_the_air_a_wrong_reading_does_not_turn_the_attitude():
    """In the air the one follows a reading that is 90 degrees off, the other the gyro alone."""
    robot = load_robot()
    tilts = []
    for make in (ESTIMATORS["imu"], ESTIMATORS["inertial in the air"]):
        estimator = make(FeetFixedKinematics(robot), 0.002)
        readings = Readings.of(robot.n_joints)
        readings.joint_position[:] = robot.crouch
        readings.gravity[:] = 0.0, 0.0, -1.0
        readings.foot_force[:] = 150.0
        start = estimator.estimate(readings).base_rotation.copy()
        readings.gravity[:] = 1.0, 0.0, 0.0
        readings.foot_force[:] = 0.0
        for _ in range(50):
            state = estimator.estimate(readings)
        tilts.append(np.linalg.norm(pin.log3(start.T @ state.base_rotation)))
    # The lift-off takes a second reading.
    assert tilts[0] > 0.1
    assert tilts[1] < 0.01


def test_a_jump_leaves_nothing_to_the_next():
    comparison = Comparison(JumpConfig.of(randomization="hard", stand_time=0.05))
    first, other, again = (comparison.jump(seed) for seed in (1, 2, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert np.isnan(first[PHASES.index("after")]).all()


def rows(value):
    """All cases, each error ten times the estimator's number more than ``value``."""
    errors = np.full((3, len(PHASES), len(ESTIMATORS), len(QUANTITIES)), value)
    errors += 10 * np.arange(len(ESTIMATORS))[:, None]
    errors[2, -1] = np.nan
    return [
        Row(control, controller, *world, errors)
        for control in estimators.CONTROLS
        for controller in ("velocity", "torque")
        for world in estimators.WORLDS
    ]


def test_medians_are_of_the_jumps_that_came_so_far():
    row = rows(0.0)[0]
    errors = row.errors.copy()
    errors[:, :, 1, 2] = np.array([1.0, 2.0, 6.0])[:, None]
    errors[2, -1] = np.nan
    row = dataclasses.replace(row, errors=errors)
    assert row.median("launch", "imu", 2) == 2.0
    assert row.median("after", "imu", 2) == 1.5
    errors[:] = np.nan
    assert math.isnan(row.median("launch", "imu", 2))


def test_conclusions_name_the_worst_case():
    found = rows(0.0)
    better = rows(-9.99)
    within = conclusions(better)
    assert "attitude in flight under full: 0.01 deg, within the aim of 0.3" in within[0]
    assert "CoM velocity in flight under full: 0.010 m/s, within the aim of 0.04" in within[1]
    assert "velocity 10.010 m/s instead of 0.010" in within[2]
    assert "gravity in the air: attitude in flight 20.01 deg" in within[4]
    beyond = conclusions([found[0], *better[1:]])
    assert "attitude in flight under full: 10.00 deg, beyond" in beyond[0]
    assert "CoM velocity in flight under full: 10.000 m/s, beyond" in beyond[1]
    assert conclusions([*better[:1], found[1], *better[2:]])[:2] == within[:2]


def test_the_command_prints_and_writes(monkeypatch, capsys):
    class Instant:
        def __init__(self, config):
            self.config = config

        def jump(self, seed):
            return np.full((len(PHASES), len(ESTIMATORS), len(QUANTITIES)), seed / 1000)

    monkeypatch.setattr(estimators, "Comparison", Instant)
    run(EstimatorOptions(episodes=3, json=Path("found.json")))
    out = capsys.readouterr().out
    assert out.startswith("attitude in flight under full: 0.20 deg, within")
    assert re.findall("^Control: (.*); seeds 200 to 202", out, re.M) == ["paper", "feedback"]
    assert (
        len(
            re.findall(r"^ CoM velocity, m/s +velocity +full, ideal( +(0.201 ?){3}){5}", out, re.M)
        )
        == 2
    )
    assert (
        len(re.findall(r"^ attitude, deg +velocity +full, ideal( +(0.20 ?){3}){5}", out, re.M))
        == 2
    )
    written = json.loads(Path("found.json").read_text())
    assert written["seeds"] == [200, 201, 202]
    assert np.shape(written["rows"][0]["errors"]) == (3, len(PHASES), len(ESTIMATORS), 4)
    assert written["quantities"][3] == "CoM velocity, m/s"


def test_the_table_has_a_row_for_every_case():
    table = render([row for row in rows(1.0) if row.control == "paper"], "title")
    assert table.row_count == len(QUANTITIES) * 6


def test_nothing_is_jumped_for_nothing(monkeypatch):
    monkeypatch.setattr(estimators, "Comparison", None)
    with pytest.raises(ConfigError, match="episodes"):
        EstimatorOptions(episodes=0)
    with pytest.raises(ConfigError, match="json"):
        run(EstimatorOptions(json=Path("nowhere/found.json")))
