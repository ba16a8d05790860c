"""The nominal jump, 4 cm at 11 cm: the numbers this project stands for."""

import math

import numpy as np
import pytest
from conftest import jump

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.evaluation.statistics.paper import PAPER as PAPERS
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()

PAPER = PAPERS["velocity"]


def test_jumps_at_least_as_high_as_the_paper(nominal):
    assert nominal.jump["flight_height"] >= PAPER["flight_height"]
    assert nominal.jump["sole_height"] >= PAPER["sole_height"]
    assert nominal.jump["flight_height"] >= 0.039


def test_lands_and_stands(nominal):
    assert nominal.outcome == "stood"
    assert nominal.jump["landed"]
    assert nominal.is_success


def test_takes_off_when_and_as_fast_as_the_paper(nominal):
    assert nominal.jump["takeoff_time"] == pytest.approx(PAPER["takeoff_time"], abs=0.01)
    assert nominal.jump["takeoff_velocity"] == pytest.approx(PAPER["takeoff_velocity"], abs=0.02)


def test_momentum_constraint_prevents_the_rotation(nominal, ablated):
    rotation, without = (
        abs(math.degrees(episode.jump["flight_rotation"])) for episode in (nominal, ablated)
    )
    assert rotation <= 1.0
    assert without >= rotation + 2.0
    assert not ablated.jump["landed"]


def test_rise_agrees_with_the_take_off_speed(nominal):
    """Ballistics: two independent ways to the same height."""
    assert nominal.jump["flight_height"] == pytest.approx(
        nominal.jump["ballistic_height"], abs=1.5e-3
    )
    flight = nominal.jump["flight_time"]
    assert flight > 2 * nominal.jump["takeoff_velocity"] / 9.81  # retracted feet land later


def test_within_the_limits(nominal):
    assert nominal.jump["limit_violations"] == 0.0
    torque = np.array([s.joint_torque for s in nominal.trace])
    speed = np.array([s.joint_velocity for s in nominal.trace])
    assert (np.abs(torque) <= ROBOT.effort_limit).all()
    assert (np.abs(speed) <= 1.03 * ROBOT.velocity_limit).all()


@pytest.mark.parametrize("controller", ["velocity", "torque"])
def test_no_solver_failure_and_hard_rows_held(controller):
    env = make_env(JumpConfig.of(controller=controller))
    env.reset(seed=0)
    residuals = []
    terminated = False
    while not terminated:
        _, _, terminated, _, info = env.step(np.zeros(3, np.float32))
        residuals.append(info["solver_primal_residual"])
    assert len([r for r in residuals if r > 0]) > 10
    assert max(residuals) <= 1e-9
    assert info["jump"]["solver_failures"] == 0.0


def test_same_jump_at_the_papers_step_of_a_tenth_of_a_millisecond(nominal):
    fine = jump(timestep=1e-4)
    assert fine.is_success
    assert fine.jump["flight_height"] == pytest.approx(nominal.jump["flight_height"], abs=2e-3)
    assert fine.jump["limit_violations"] == 0.0


def test_osqp_jumps_the_same(nominal):
    osqp = jump(solver="osqp")
    assert osqp.jump["solver_failures"] == 0.0
    assert osqp.jump["flight_height"] == pytest.approx(nominal.jump["flight_height"], abs=1e-3)


def test_scaling_by_acceleration_jumps_and_lands():
    episode = jump(com_scaling="acceleration")
    assert episode.is_success
    assert episode.jump["takeoff_time"] == pytest.approx(0.332, abs=0.01)


@pytest.mark.parametrize("height", [0.01, 0.02, 0.03, 0.05])
def test_other_commands_succeed(height):
    assert jump(jump_height=height, stand_time=0.5).is_success


@pytest.mark.parametrize("displacement", [0.08, 0.14])
def test_other_displacements_succeed(displacement):
    assert jump(com_displacement=displacement, stand_time=0.5).is_success


def test_without_the_ankle_shift_it_still_lands_but_lower(nominal):
    """Why the paper changed the ankle."""
    episode = jump(ankle_shift=False)
    assert episode.jump["landed"]
    assert episode.jump["flight_height"] < 0.7 * nominal.jump["flight_height"]


def test_tracks_the_com_reference(nominal):
    launch = [s for s in nominal.trace if s.phase == "launch"]
    error = np.array([s.com - s.com_reference for s in launch])
    assert np.abs(error[:, 2]).max() < 3e-3
    assert np.abs(error[:, :2]).max() < 6e-3
