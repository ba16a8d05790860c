"""Launch, flight and landing, and the controller that goes from one to the next."""

import dataclasses

import numpy as np
import pytest
from standing import ROBOT, STANCE, N, Standing

from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import PhaseConfig, TorqueConfig, VelocityConfig
from icub_jump_env.control.flight import MinimumJerkFlight
from icub_jump_env.control.jump import JumpController
from icub_jump_env.control.landing import HoldLanding
from icub_jump_env.control.launch import Launch
from icub_jump_env.control.phases import Phase
from icub_jump_env.control.qp.problem import IDLE
from icub_jump_env.planning.lean import gravity_in_imu, lean_correction
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import N_AXES, RESIDUAL_TIME, ResidualConfig, ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlan, plan_com_trajectory

DT = 1 / 256  # of which sums are exact
PLAN = ScaledCurvePlan(plan_com_trajectory(0.04), ROBOT, STANCE)
SHIFT = np.array([0.02, -0.01, 0.01, 0.3, -0.4])
NOTHING = np.zeros(N_AXES)
DOWN = gravity_in_imu(STANCE)


class Recording:
    """A tracking controller that notes what it shall track."""

    report = IDLE

    def __init__(self):
        self.asked, self.resets = [], 0

    def reset(self, stance):
        assert stance is PLAN.stance
        self.resets += 1

    def command(self, state, setpoint):
        self.asked.append(
            [setpoint.com_position.copy(), setpoint.com_velocity.copy(),
             setpoint.com_acceleration.copy()]
        )  # fmt: skip
        return JointCommand(np.ones(N))


class TestLaunch:
    def test_tracks_the_plan_moved_by_the_residual_of_the_actions_before(self):
        """What an action moves is the set point of the next tick on."""
        standing, tracking = Standing(0), Recording()
        launch = Launch(tracking, Reference(ResidualFilter(15.0)), DT)
        launch.start(standing.state, PLAN, 0.0)
        assert tracking.resets == 1
        ours = ResidualFilter(15.0)
        for k in range(5):
            tick = launch.tick(standing.state, k * DT, (k + 1) * SHIFT)
            assert tick.report is IDLE
            rise = PLAN.trajectory.sample(k * DT)
            for asked, planned, residual in zip(
                tracking.asked[k],
                (rise.position, rise.velocity, rise.acceleration),
                (standing.state.com + ours.offset[:3], ours.velocity[:3], ours.acceleration[:3]),
                strict=True,
            ):
                np.testing.assert_allclose(asked, residual + [0, 0, planned], rtol=1e-15)
            ours.step((k + 1) * SHIFT, DT)


class TestFlight:
    def begun(self, shift=None):
        residual, standing = ResidualFilter(15.0), Standing(1)
        residual.step(SHIFT, 0.1)  # as a launch leaves it
        flight = MinimumJerkFlight(residual, DT, shift)
        flight.start(standing.state, PLAN, 0.5)
        return flight, standing

    def test_moves_from_where_the_joints_are_to_the_landing_posture(self):
        flight, standing = self.begun()
        start = standing.state.joint_position.copy()
        standing.move(2)  # the state is a buffer
        first, last = (
            flight.tick(standing.state, 0.5 + late, SHIFT)
            for late in (0.0, PLAN.retraction_time + 0.01)
        )
        np.testing.assert_array_equal(first.command.position, start)
        np.testing.assert_allclose(last.command.position, PLAN.landing_posture, atol=1e-12)
        for tick in (first, last):
            assert not tick.command.velocity.any()
            assert tick.command.torque is None
            assert tick.report is None

    def test_velocities_are_those_of_the_positions(self):
        flight, standing = self.begun()
        h = 1e-6
        before, here, after = (
            flight.tick(standing.state, 0.55 + late, NOTHING).command for late in (-h, 0.0, h)
        )
        rate = (after.position - before.position) / (2 * h)
        np.testing.assert_allclose(here.velocity, rate, atol=1e-6)

    def test_the_residual_of_the_launch_is_forgotten(self):
        rng = np.random.default_rng(0)
        flight, standing = self.begun(rng.normal(size=(N, 3)))
        command = flight.tick(standing.state, 0.5, NOTHING).command
        np.testing.assert_array_equal(command.position, standing.state.joint_position)
        assert not command.velocity.any()

    def test_the_residual_moves_the_posture(self):
        shift = np.random.default_rng(0).normal(size=(N, 3))
        flight, standing = self.begun(shift)
        command = flight.tick(standing.state, 0.5, SHIFT).command
        ours = ResidualFilter(15.0)
        ours.step(SHIFT, DT)
        moved = command.position - standing.state.joint_position
        np.testing.assert_allclose(moved, shift @ ours.offset[:3], atol=1e-12)
        np.testing.assert_allclose(command.velocity, shift @ ours.velocity[:3], atol=1e-12)

    def test_landing_goes_on_with_the_motion(self):
        flight, standing = self.begun()
        landing = HoldLanding(flight)
        expected = flight.tick(standing.state, 0.55, NOTHING).command
        landing.start(standing.state, PLAN, 0.55)
        landed = landing.tick(standing.state, 0.55, NOTHING).command
        np.testing.assert_array_equal(landed.position, expected.position)
        np.testing.assert_array_equal(landed.velocity, expected.velocity)


CONFIGS = {
    "velocity": VelocityConfig(frequency=256.0),
    "torque": TorqueConfig(frequency=256.0),
    "velocity, hard": VelocityConfig(frequency=256.0, constraints="hard"),
}


class Jumper:
    """A controller on a robot that stands, is in the air, and stands again."""

    def __init__(self, config, phases="all", residual=SHIFT, gravity=DOWN, lean=False):
        self.residual, self.gravity = residual, gravity
        self.standing = Standing(0)
        self.controller = JumpController(
            config, ResidualConfig(phases=phases), self.standing.kinematics, lean
        )

    def jump(self, began, plan=PLAN):
        """Commands and phases of one jump."""
        self.standing.move(0)
        self.controller.start(plan, self.standing.state, began, self.gravity)
        commands, phases = [], []
        for k in range(160):
            time = k * DT
            self.standing.move(k)
            state = self.standing.state
            state.foot_force = np.full(2, 0.0 if 0.45 < time < 0.6 else 162.0)
            tick = self.controller.tick(state, began + time, self.residual)
            commands += [part.copy() for part in tick.command if part is not None]
            phases.append(self.controller.phases.phase)
        return commands, phases

    def same_jump(self, other):
        (commands, phases), (others, other_phases) = self.jump(0.0), other
        assert phases == other_phases
        assert set(phases) == set(Phase)
        assert len(commands) == len(others)
        for ours, theirs in zip(commands, others, strict=True):
            np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("name", CONFIGS)
def test_a_jump_does_not_depend_on_when_it_begins(name):
    late = Jumper(CONFIGS[name])
    Jumper(CONFIGS[name]).same_jump(late.jump(4.0))
    assert late.controller.jump_time(4.5) == 0.5


@pytest.mark.parametrize("name", CONFIGS)
def test_a_second_jump_is_like_the_first(name):
    """Whatever came before it: integrals, previous commands, residual and phase are new."""
    used = Jumper(CONFIGS[name])
    used.jump(0.0, ScaledCurvePlan(plan_com_trajectory(0.03), ROBOT, STANCE))
    Jumper(CONFIGS[name]).same_jump(used.jump(2.0))


@pytest.mark.parametrize(("phases", "until"), [("launch", None), ("all", RESIDUAL_TIME)])
def test_when_a_residual_acts_is_told_by_the_clock_of_the_jump(phases, until):
    jumper = Jumper(VelocityConfig(), phases)
    controller, began = jumper.controller, 4.0
    controller.start(PLAN, jumper.standing.state, began, DOWN)
    T = PLAN.duration
    for late in (0.0, T, T + RESIDUAL_TIME - 0.01, T + RESIDUAL_TIME + 0.01):
        acts = True if until is None else late < T + until
        assert controller.residual_acts(began + late) is acts
    controller.phases.phase = Phase.FLIGHT
    assert not controller.launching
    assert controller.residual_acts(began + 0.1) is (phases == "all")


@pytest.mark.parametrize("name", ["velocity", "torque"])
def test_the_correction_of_the_lean_is_a_residual_of_the_launch_alone(name):
    leaning = DOWN - [0.1, 0.05, 0.0]
    corrected = Jumper(CONFIGS[name], "launch", NOTHING, leaning, lean=True)
    residual = lean_correction(leaning, STANCE)
    assert residual.tolist() == [0.0, 0.0, 0.0, 0.0, pytest.approx(6.0 * 0.1)]
    assert not lean_correction(DOWN + [0.1, 0.05, 0.0], STANCE).any()
    Jumper(CONFIGS[name], "launch", residual, leaning).same_jump(corrected.jump(0.0))
    commands, _ = Jumper(CONFIGS[name], "launch", NOTHING, leaning).jump(0.0)
    assert not all(map(np.array_equal, commands, corrected.jump(0.0)[0]))


def test_phases_end_as_configured():
    config = dataclasses.replace(
        CONFIGS["velocity"], phases=PhaseConfig(launch_end="lift_off", lift_off_ticks=3)
    )
    _, phases = Jumper(config).jump(0.0)
    unloaded = next(k for k in range(160) if k * DT > 0.45)
    assert phases.index(Phase.FLIGHT) == unloaded + 2
    assert unloaded * DT > PLAN.duration
