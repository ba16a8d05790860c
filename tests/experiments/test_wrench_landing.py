"""Landing by a QP with contact wrenches: what it may ask of the soles, and what is printed."""

import re

import numpy as np
import pytest

from experiments import wrench_landing
from experiments.wrench_controller import WrenchGains, WrenchLanding, soles_damped
from experiments.wrench_landing import (
    HARDEST,
    PARTS,
    WrenchOptions,
    cases,
    landing_by_wrenches,
    run,
    watch,
)
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.qp.problem import IDLE, QPStatus
from icub_jump_env.errors import ConfigError
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot

SEED = 40


@pytest.fixture(scope="module")
def pushed():
    """A landing that is pushed back: the jump, and of each tick of the QP what it decided."""
    found = []
    tick = WrenchLanding.tick

    def watched(self, state, time, residual_target):
        came = tick(self, state, time, residual_target)
        dynamics, x = self.dynamics, self.solution.copy()
        residual = dynamics.base_rows @ x - dynamics.base_bias
        found.append(
            (time - self._began, came, x[-12:].reshape(2, 6), residual, self.torque.copy())
        )
        return came

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WrenchLanding, "tick", watched)
        env = make_env(cases("torque")[HARDEST])
        watch(env, WrenchGains())
        jump = run_episode(env, SEED).jump
    return jump, found


def decided(pushed):
    return [
        tick for tick in pushed[1] if tick[0] >= WrenchGains().impact and not tick[1].report.failed
    ]


def test_it_lands_although_it_is_pushed(pushed):
    jump, found = pushed
    assert jump["landed"]
    assert sum(came.report.failed for _, came, *_ in found) < 0.01 * len(found)


def test_the_soles_can_transmit_what_it_asks_for(pushed):
    gains, sole = WrenchGains(), load_robot().sole
    wrenches = np.array([wrench for _, _, wrench, _, _ in decided(pushed)])
    Fx, Fy, Fz, Mx, My, _ = np.moveaxis(wrenches, 2, 0)
    assert Fz.min() >= gains.least_force - 1e-6
    assert (np.maximum(abs(Fx), abs(Fy)) <= gains.friction * Fz + 1e-6).all()
    x, y = (sole.bottom * Fx - My) / Fz, (sole.bottom * Fy + Mx) / Fz
    # The push asks for the heels, so the margin is used up, but not more than that.
    assert x.min() == pytest.approx(sole.x_min + gains.cop_margin, abs=1e-6)
    assert x.max() <= sole.x_max - gains.cop_margin + 1e-6
    assert np.abs(y).max() <= sole.half_width - gains.cop_margin + 1e-6


def test_wrenches_and_accelerations_obey_the_equations_of_motion(pushed):
    assert len(decided(pushed)) > 500
    for *_, residual, _ in decided(pushed):
        np.testing.assert_allclose(residual, 0.0, atol=1e-6)
    mass = FeetFixedKinematics(load_robot()).mass
    wrenches = decided(pushed)[-1][2]
    # At the end it stands.
    assert wrenches[:, 2].sum() == pytest.approx(9.81 * mass, rel=0.1)


def test_the_servos_take_the_impact_and_torques_the_rest(pushed):
    gains, limit = WrenchGains(), load_robot().effort_limit
    for since, came, _, _, torque in pushed[1]:
        if since < gains.impact:
            assert came.command.position is not None
            continue
        assert came.command.position is None
        assert (np.abs(came.command.torque) <= limit).all()
        if not came.report.failed:
            assert (np.abs(torque) <= limit + 1e-6).all()
    late = [came.command.torque - torque for _, came, _, _, torque in decided(pushed)[-50:]]
    assert np.abs(late).max() < 1.0


@pytest.mark.parametrize("weight", [1.0, 100.0])
def test_a_motion_of_the_soles_relative_to_each_other_is_taken_off(weight):
    rng = np.random.default_rng(0)
    kinematics = FeetFixedKinematics(load_robot())
    s, s_dot = load_robot().landing.copy(), rng.normal(size=23)
    kinematics.update(s)
    dynamics = FeetFixedDynamics(kinematics)
    dynamics.update(s, s_dot)
    state = RobotState({"n": 23}, joint_position=s, joint_velocity=s_dot)
    rows, target = np.zeros((6, 35)), np.zeros(6)
    blocks = (part.block[0] for part in (kinematics, dynamics, state))
    soles_damped(*blocks, 0.2, 30.0, np.sqrt(weight), rows, target)
    s_ddot = np.linalg.lstsq(rows[:, :23], target, rcond=None)[0]
    # From now until the next tick, left minus right: its error from the wanted speed shrinks.
    wanted = np.zeros(6)
    wanted[:3] = -0.2 * kinematics.base_rotation[2]
    error = kinematics.J_feet @ s_dot - wanted
    gained = 0.005 * (kinematics.J_feet @ s_ddot - dynamics.foot_bias)
    np.testing.assert_allclose(gained, -0.15 * error, rtol=1e-9, atol=1e-9)


def test_without_a_solution_the_torques_fade():
    env = make_env(JumpConfig.of(estimator="imu", flight="feedback", landing="feedback"))
    env.reset(seed=SEED)
    landing = landing_by_wrenches(env, WrenchGains(impact=0.0))
    landing.start(env._state, env._controller.plan, 0.0)
    held = landing.tick(env._state, 0.0, np.zeros(5))
    before = landing.torque.copy()
    assert not held.report.failed
    assert np.abs(before).max() > 1.0
    failed = IDLE._replace(status=QPStatus.INFEASIBLE)
    landing._wrench_solver.solve = lambda: (None, failed)
    failed = landing.tick(env._state, 0.005, np.zeros(5))
    assert failed.report.failed
    np.testing.assert_allclose(landing.torque, 0.9 * before)
    assert np.abs(failed.command.torque - landing.torque).max() < 1.0


def test_only_a_landing_by_feedback_is_replaced():
    with pytest.raises(TypeError, match="feedback"):
        landing_by_wrenches(make_env(JumpConfig.of()), WrenchGains())


@pytest.mark.parametrize("parts", [False, True])
def test_the_command_prints_both_controllers(parts, monkeypatch, capsys):
    monkeypatch.setattr(wrench_landing, "CASES", ("4 cm, full", HARDEST))
    monkeypatch.setattr(wrench_landing, "PARTS", dict(list(PARTS.items())[:1]))
    run(WrenchOptions(episodes=1, parts=parts))
    out = capsys.readouterr().out
    assert re.findall(r"^(\w+) controller, ", out, re.M) == ["velocity", "torque"]
    name = "all parts" if parts else "wrench QP"
    rows = re.findall(rf"{name} +([01])/1 +- +(\d+) +(\d+) +(\d+) *$", out, re.M)
    assert len(rows) == (2 if parts else 4)
    assert parts or len(re.findall("feedback +[01]/1", out)) == 4
    for _, force, _, time in rows:
        assert 300 < int(force) < 3000
        assert int(time) > 0


def test_the_seeds_that_chose_the_gains_are_not_jumped():
    with pytest.raises(ConfigError, match="episodes"):
        WrenchOptions(episodes=161)
