"""Re-planning of the CoM: the QP's answers, and what it changes in a jump."""

import copy

import numpy as np
import pytest
from conftest import jump

from experiments import receding_horizon
from experiments.receding_horizon import (
    COP_MARGIN,
    FRICTION,
    LEAST_LOAD,
    ComReplanner,
    PlannedMotion,
    RecedingHorizonOptions,
    Replanning,
    compare_plans,
    replan,
)
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env, planned, run_episode
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics

CONFIG = JumpConfig.of(planner="whole_body", jump_height=0.07, stand_time=0.1)
KINEMATICS = FeetFixedKinematics(CONFIG.robot_value)
SOLE = KINEMATICS.robot.sole


def motion_of(height):
    plan = CONFIG.make_planner(KINEMATICS).plan(height)
    KINEMATICS.update(plan.stance.posture)
    return PlannedMotion.of(plan, KINEMATICS.com.copy())


MOTION = motion_of(0.07)
REPLANNER = ComReplanner(SOLE, KINEMATICS.mass)


def contact(com, acceleration, momentum_rate):
    """Load (weights), friction in use, and CoP (m), exactly."""
    load = acceleration[:, 1] + GRAVITY
    moment = com[:, 1] * acceleration[:, 0] + momentum_rate / KINEMATICS.mass
    return load / GRAVITY, np.abs(acceleration[:, 0]) / load, com[:, 0] - moment / load


def assert_allowed(com, acceleration, momentum_rate, tolerance=0.0):
    load, friction, cop = contact(com, acceleration, momentum_rate)
    assert load.min() > LEAST_LOAD - 1e-6
    assert friction.max() < FRICTION + tolerance
    assert SOLE.x_min + COP_MARGIN - tolerance < cop.min()
    assert cop.max() < SOLE.x_max - COP_MARGIN + tolerance


@pytest.mark.parametrize("height", [0.03, 0.05, 0.07])
@pytest.mark.parametrize("time", [0.0, 0.2, 0.44])
def test_on_the_plan_it_returns_the_plan_which_keeps_the_constraints(height, time):
    motion = motion_of(height)
    assert_allowed(motion.com, motion.acceleration, motion.momentum_rate)
    found = REPLANNER.solve(motion, time, np.zeros(2), np.zeros(2))
    assert found.start + 10 * found.step == pytest.approx(motion.time[-1])
    for instant in np.linspace(time, motion.time[-1], 7):
        assert not np.any(found.at(instant))


@pytest.mark.parametrize("time", [0.0, 0.2, 0.4])
def test_off_the_plan_it_takes_off_as_planned_within_the_constraints(rng, time):
    for _ in range(20):
        offset, velocity = rng.uniform(-0.004, 0.004, 2), rng.uniform(-0.02, 0.02, 2)
        found = REPLANNER.solve(MOTION, time, offset, velocity)
        position, speed, _ = found.at(time)
        np.testing.assert_allclose([position, speed], [offset, velocity], rtol=0, atol=1e-12)
        nodes = np.linspace(time, MOTION.time[-1], 11)
        planned = MOTION.at(nodes)
        points = np.array([found.at(node) for node in nodes])
        assert_allowed(
            planned.com + points[:, 0], planned.acceleration + points[:, 2], planned.momentum_rate,
            tolerance=0.02,
        )  # fmt: skip
        assert np.abs(points[-1, 1]).max() < 1e-3
        assert np.abs(points[-1, 0]).max() < 0.01


def test_the_deviation_is_the_integral_of_its_acceleration():
    found = REPLANNER.solve(MOTION, 0.1, np.array([0.004, -0.003]), np.array([-0.02, 0.03]))
    times = np.linspace(0.1, MOTION.time[-1], 4001)
    position, velocity, acceleration = np.array([found.at(t) for t in times]).transpose(1, 0, 2)
    for value, rate in ((position, velocity), (velocity, acceleration)):
        steps = (rate[1:] + rate[:-1]) / 2 * np.diff(times)[:, None]
        np.testing.assert_allclose(value[1:] - value[0], np.cumsum(steps, axis=0), atol=1e-6)


def test_where_no_motion_is_allowed_there_is_none():
    assert REPLANNER.solve(MOTION, 0.2, np.array([-1.0, 0.0]), np.zeros(2)) is None


class Blind(Replanning):
    """Believes the CoM to be on the plan."""

    def _replan(self, state, setpoint, time):
        on_plan = copy.deepcopy(state)
        on_plan.com, on_plan.com_velocity = setpoint.com_position, setpoint.com_velocity
        super()._replan(on_plan, setpoint, time)


@pytest.mark.parametrize(("controller", "height"), [("velocity", 0.07), ("torque", 0.065)])
def test_replanned_from_the_plan_it_is_the_same_jump_bit_for_bit(monkeypatch, controller, height):
    config = CONFIG.replace(controller=controller, jump_height=height)
    monkeypatch.setattr(receding_horizon, "Replanning", Blind)
    env = make_env(config)
    replanning = replan(env, "state")
    assert run_episode(env, seed=0).jump == run_episode(make_env(config), seed=0).jump
    assert replanning.solves == round(planned(config).duration / receding_horizon.PERIOD)
    assert replanning.failures == 0


def test_a_failed_replanning_leaves_the_plan(monkeypatch):
    monkeypatch.setattr(ComReplanner, "solve", lambda *_: None)
    env = make_env(CONFIG)
    replanning = replan(env, "position")
    assert run_episode(env, seed=0).jump == run_episode(make_env(CONFIG), seed=0).jump
    solves = round(planned(CONFIG).duration / receding_horizon.PERIOD)
    assert replanning.failures == replanning.solves == solves > 20


def test_the_table_has_a_row_of_each_source(monkeypatch, capsys):
    monkeypatch.setattr(receding_horizon, "WORLDS", ("hard",))
    monkeypatch.setattr(receding_horizon, "COMMANDS", {"velocity": (0.05,)})
    compare_plans(RecedingHorizonOptions(episodes=1))
    out = capsys.readouterr().out
    planned = jump(planner="whole_body", jump_height=0.05, randomization="hard").jump
    rows = [line.split() for line in out.splitlines() if line.lstrip().startswith("hard")]
    assert [row[2:4] for row in rows] == [
        ["as", "planned"],
        ["from", "position"],
        ["from", "state"],
    ]
    assert f"{100 * planned['flight_height']:.2f}" in rows[0]
