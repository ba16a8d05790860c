"""Actuators: limits, tracking, no wind-up, torque loops, friction, motors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.command import JointCommand
from icub_jump_env.errors import ConfigError
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.actuators.actuators import Actuators, actuate
from icub_jump_env.simulation.actuators.config import ACTUATORS, FRICTION, ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor, RatedMotor
from icub_jump_env.simulation.actuators.servo import ServoGains
from icub_jump_env.simulation.actuators.torque_loops import (
    CurrentControl,
    IdealTorque,
    TorqueFeedback,
)

ROBOT = load_robot()

DT = 0.001
N = ROBOT.n_joints
zeros, ones = np.zeros(N), np.ones(N)
vectors = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).normal(size=N))


def of(config, strength=ones, gain_scale=ones) -> Actuators:
    return Actuators(config, ROBOT, DT, strength, gain_scale)


def actuators(position=zeros, torque=zeros, **models) -> Actuators:
    made = of(ActuatorConfig(**models))
    made.reset(position, torque)
    return made


def motor_torque(made, position, velocity):
    """Advance by a physics step; what the motors give."""
    torque = np.full(N, np.nan)
    actuate(position, velocity, made.drives.block, torque)
    return torque


def joint_torque(made, position, velocity):
    """What reaches the joint: motor torque less friction."""
    return motor_torque(made, position, velocity) - made.drives.friction


class TestLimits:
    @given(vectors, vectors, vectors, st.floats(0.0, 50.0), st.sampled_from(sorted(ACTUATORS)))
    def test_motor_torque_stays_within_the_limits(self, position, velocity, command, size, name):
        made = of(ACTUATORS[name])
        made.reset(zeros, zeros)
        for wanted in (JointCommand(size * command), JointCommand(torque=size * 10 * command)):
            made.command(wanted)
            for _ in range(5):
                torque = motor_torque(made, size * position, size * velocity)
                assert (np.abs(torque) <= ROBOT.effort_limit).all()

    @given(st.floats(0.0, 1.0))
    def test_no_torque_drives_a_joint_beyond_its_top_speed(self, share):
        """At 1.03 x the speed limit the torque in the direction of motion is gone."""
        made = actuators()
        made.command(JointCommand(10 * ROBOT.velocity_limit))
        speed = ROBOT.velocity_limit * (1.0 + 0.03 * share)
        torque = motor_torque(made, zeros, speed)
        np.testing.assert_allclose(torque, ROBOT.effort_limit * (1 - share), atol=1e-9)
        assert (motor_torque(made, zeros, 1.05 * ROBOT.velocity_limit) < 0).all()

    def test_weak_motors_give_their_share(self, rng):
        strength = rng.uniform(0.5, 1.0, N)
        made = of(ActuatorConfig(), strength=strength)
        made.reset(zeros, zeros)
        made.command(JointCommand(torque=1e3 * ones))
        np.testing.assert_allclose(motor_torque(made, zeros, zeros), strength * ROBOT.effort_limit)

    def test_dc_motor_follows_current_and_voltage(self):
        motor = DCMotor(current_limit=0.7, voltage_limit=0.9, stall_torque=3.0, no_load_speed=1.2)
        made = actuators(motor=motor)
        made.command(JointCommand(torque=1e3 * ones))
        for speed in np.linspace(-1.2, 1.3, 11):  # in speed limits
            line = 3.0 * (0.9 - speed / 1.2)
            share = max(-0.7, min(0.7, line))
            for direction in (1.0, -1.0):
                made.command(JointCommand(torque=direction * 1e3 * ones))
                torque = motor_torque(made, zeros, direction * speed * ROBOT.velocity_limit)
                np.testing.assert_allclose(
                    torque, direction * share * ROBOT.effort_limit, atol=1e-9
                )

    @pytest.mark.parametrize("motor", [RatedMotor(), DCMotor()])
    def test_weak_motors_are_weak_at_every_speed(self, rng, motor):
        strength = rng.uniform(0.5, 1.0, N)
        weak = of(ActuatorConfig(motor=motor), strength=strength)
        strong = actuators(motor=motor)
        for speed in (0.0, 0.97, 1.01):
            for made in (weak, strong):
                made.reset(zeros, zeros)
                made.command(JointCommand(torque=1e3 * ones))
            expected = strength * motor_torque(strong, zeros, speed * ROBOT.velocity_limit)
            np.testing.assert_allclose(
                motor_torque(weak, zeros, speed * ROBOT.velocity_limit), expected, atol=1e-9
            )

    def test_raised_limits_are_the_default(self):
        """The documented corner: full torque until 0.94, 0.8 of it at the speed limit."""
        made = actuators(motor=DCMotor())
        made.command(JointCommand(torque=1e3 * ones))
        for speed, share in ((0.93, 1.0), (0.9375, 1.0), (1.0, 0.8), (1.25, 0.0)):
            torque = motor_torque(made, zeros, speed * ROBOT.velocity_limit)
            np.testing.assert_allclose(torque, share * ROBOT.effort_limit, atol=1e-9)


class TestServo:
    def test_reset_holds_with_the_given_torque(self, rng):
        torque = 0.5 * ROBOT.effort_limit * rng.uniform(-1, 1, N)
        made = actuators(ROBOT.crouch, torque)
        np.testing.assert_allclose(motor_torque(made, ROBOT.crouch, zeros), torque, atol=1e-9)

    @pytest.mark.parametrize("name", ["ideal", "realistic"])
    def test_velocity_command_is_tracked_without_offset(self, rng, name):
        """A joint of known inertia under a constant load reaches the commanded velocity."""
        inertia, load = ROBOT.armature + 0.05, 0.3 * ROBOT.effort_limit
        goal = 0.3 * ROBOT.velocity_limit * np.sign(rng.normal(size=N))
        made = of(ACTUATORS[name])
        made.reset(zeros, zeros)
        made.command(JointCommand(goal))
        s, s_dot = np.zeros(N), np.zeros(N)
        for _ in range(1500):
            s_dot = s_dot + DT * (joint_torque(made, s, s_dot) - load) / inertia
            s = s + DT * s_dot
        np.testing.assert_allclose(s_dot, goal, atol=1e-3)

    def test_position_command_replaces_the_reference(self):
        made = actuators()
        made.command(JointCommand(zeros, position=np.full(N, 0.001)))
        np.testing.assert_allclose(
            motor_torque(made, zeros, zeros), 0.001 * ServoGains().stiffness
        )

    def test_gains_are_scaled_per_joint(self, rng):
        scale = rng.uniform(0.5, 1.5, N)
        made = of(ActuatorConfig(), gain_scale=scale)
        made.reset(zeros, zeros)
        made.command(JointCommand(zeros, position=np.full(N, 0.001)))
        gains = ServoGains()
        np.testing.assert_allclose(
            motor_torque(made, zeros, np.full(N, 0.1)),
            scale * (0.001 * gains.stiffness - 0.1 * gains.damping),
        )

    def test_does_not_wind_up(self):
        """After a long time against a stop, a small command backward acts at once."""
        made = actuators()
        made.command(JointCommand(ROBOT.velocity_limit))
        for _ in range(3000):
            torque = motor_torque(made, zeros, zeros)
        np.testing.assert_allclose(torque, ROBOT.effort_limit)
        backward = 0.01 * ROBOT.velocity_limit
        made.command(JointCommand(-backward))
        # What the stop left behind is the error that the effort limit can use, no more.
        worst = (ROBOT.effort_limit / ServoGains().stiffness / backward).max()
        for _ in range(math.ceil(worst / DT)):
            torque = motor_torque(made, zeros, zeros)
        assert (torque < 0).all()

    def test_reset_forgets_the_command(self):
        made = actuators()
        made.command(JointCommand(ROBOT.velocity_limit))
        made.reset(zeros, zeros)
        assert not made.drives.velocity_command.any()
        assert not motor_torque(made, zeros, zeros).any()


class TestTorqueLoops:
    def step_response(self, loop, steps, goal=5.0, velocity=zeros, friction=0.0, error=0.0):
        """Joint torques at each step after a step of the command from 0 to ``goal``."""
        made = actuators(torque_loop=loop, friction=friction)
        made.drives.torque_error[:] = error
        made.command(JointCommand(torque=np.full(N, goal)))
        return np.array([joint_torque(made, zeros, velocity)[0] for _ in range(steps)])

    def test_ideal_is_immediate(self):
        assert (self.step_response(IdealTorque(), 3) == 5.0).all()

    @pytest.mark.parametrize("bandwidth", [2.0, 10.0, 30.0])
    def test_feedback_is_a_first_order_lag_of_its_bandwidth(self, bandwidth):
        response = self.step_response(TorqueFeedback(bandwidth, delay=0.0), 200)
        time = DT * np.arange(1, 201)
        expected = 5.0 * (1 - np.exp(-2 * math.pi * bandwidth * time))
        np.testing.assert_allclose(response, expected, atol=1e-9)

    def test_feedback_rejects_friction_and_current_control_does_not(self):
        turning = 2.0 * ones
        friction = 0.05 * ROBOT.effort_limit[0]
        feedback = self.step_response(TorqueFeedback(20.0), 400, 5.0, turning, friction=0.05)[-1]
        current = self.step_response(
            CurrentControl(200.0, 0.6, 1.0), 400, 5.0, turning, friction=0.05
        )[-1]
        assert feedback == pytest.approx(5.0, abs=1e-6)
        assert current == pytest.approx(5.0 - 0.4 * friction, abs=1e-6)

    def test_feedback_follows_the_error_of_the_measurement_and_current_control_does_not(self):
        assert self.step_response(TorqueFeedback(), 400, error=1.5)[-1] == pytest.approx(3.5)
        with_error, without = (
            self.step_response(CurrentControl(), 400, error=error) for error in (1.5, 0.0)
        )
        np.testing.assert_array_equal(with_error, without)

    @pytest.mark.parametrize("bandwidth", [20.0, 200.0])
    def test_current_control_is_a_first_order_lag_of_its_bandwidth(self, bandwidth):
        response = self.step_response(CurrentControl(bandwidth, torque_constant=1.0), 60)
        time = DT * np.arange(1, 61)
        expected = 5.0 * (1 - np.exp(-2 * math.pi * bandwidth * time))
        np.testing.assert_allclose(response, expected, atol=1e-9)

    @pytest.mark.parametrize("bandwidth", [100.0, 1000.0])
    def test_feedback_without_delay_is_stable_at_any_bandwidth(self, bandwidth):
        response = self.step_response(TorqueFeedback(bandwidth, delay=0.0), 200)
        assert response.max() <= 5.0 + 1e-9
        assert response[-1] == pytest.approx(5.0)

    @pytest.mark.parametrize("loop", [TorqueFeedback(20.0, 0.01), CurrentControl(5.0)])
    def test_a_second_episode_is_like_the_first(self, loop):
        made = actuators(torque_loop=loop, friction=0.05)
        courses = []
        for _ in range(2):
            made.reset(zeros, ones)
            made.command(JointCommand(torque=np.full(N, 5.0)))
            courses.append([motor_torque(made, zeros, ones) for _ in range(40)])
            made.drives.torque_error[:] = 7.0
        np.testing.assert_array_equal(courses[0], courses[1])

    def test_current_control_is_as_good_as_its_torque_constant(self):
        response = self.step_response(CurrentControl(torque_constant=0.9), 200)
        assert response[-1] == pytest.approx(4.5, abs=1e-6)

    def test_delay_of_the_measurement_makes_the_loop_overshoot_and_then_unstable(self):
        calm, swinging, unstable = (
            self.step_response(TorqueFeedback(bandwidth, delay=0.008), 400).max()
            for bandwidth in (2.0, 20.0, 60.0)
        )
        assert calm <= 5.0 + 1e-9
        assert 5.5 < swinging < 10.0
        assert unstable > 20.0  # 2 pi 60 x 0.008 is beyond pi / 2

    def test_feedback_does_not_wind_up(self):
        made = actuators(torque_loop=TorqueFeedback(20.0, 0.0))
        made.command(JointCommand(torque=1e4 * ones))
        for _ in range(1000):
            motor_torque(made, zeros, zeros)
        made.command(JointCommand(torque=zeros))
        for _ in range(50):
            torque = motor_torque(made, zeros, zeros)
        assert (np.abs(torque) < 0.01 * ROBOT.effort_limit).all()

    @pytest.mark.parametrize("loop", [TorqueFeedback(), CurrentControl()])
    def test_torque_control_starts_where_the_servo_left_off(self, rng, loop):
        holding = 0.5 * ROBOT.effort_limit * rng.uniform(-1, 1, N)
        made = actuators(ROBOT.crouch, holding, torque_loop=loop)
        motor_torque(made, ROBOT.crouch, zeros)
        made.command(JointCommand(torque=holding))
        np.testing.assert_allclose(
            motor_torque(made, ROBOT.crouch, zeros), holding, atol=0.03 * ROBOT.effort_limit.max()
        )


class TestFriction:
    @given(vectors)
    def test_opposes_motion_with_the_coulomb_torque(self, velocity):
        made = actuators(friction=0.1)
        made.command(JointCommand(torque=zeros))
        torque = joint_torque(made, zeros, velocity)
        assert (torque * velocity <= 0).all()
        assert (np.abs(torque) <= 0.1 * ROBOT.effort_limit + 1e-12).all()
        fast = np.abs(velocity) > 0.3
        np.testing.assert_allclose(
            torque[fast], -0.1 * (np.sign(velocity) * ROBOT.effort_limit)[fast], rtol=1e-4
        )

    def test_share_at_the_knee_as_documented(self):
        knee = ROBOT.joint_names.index("l_knee")
        assert FRICTION * ROBOT.effort_limit[knee] == pytest.approx(2.2, abs=0.05)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (ServoGains, {"stiffness": 0.0}),
        (ServoGains, {"damping": -1.0}),
        (RatedMotor, {"speed_band": 0.0}),
        (DCMotor, {"current_limit": 1.1}),
        (DCMotor, {"voltage_limit": math.nan}),
        (DCMotor, {"stall_torque": 0.5}),
        (DCMotor, {"no_load_speed": 0.0}),
        (TorqueFeedback, {"bandwidth": 0.0}),
        (TorqueFeedback, {"delay": -0.001}),
        (CurrentControl, {"bandwidth": "fast"}),
        (CurrentControl, {"friction_compensation": -1.0}),
        (CurrentControl, {"torque_constant": 0.0}),
        (ActuatorConfig, {"friction": 0.3}),
        (ActuatorConfig, {"motor": "dc"}),
        (ActuatorConfig, {"torque_loop": DCMotor()}),
        (ActuatorConfig, {"servo": None}),
        (IdealTorque, {"kind": "perfect"}),
    ],
)
def test_bad_values_are_refused(kind, values):
    with pytest.raises(ConfigError) as refusal:
        kind(**values)
    assert refusal.value.field in values


class TestMixedControl:
    """Some joints under torque control, the others with the servo."""

    driven = np.arange(N) % 3 == 0

    def mixed(self, rng, made):
        position, velocity, torque = 0.01 * rng.normal(size=N), rng.normal(size=N), np.arange(N)
        made.command(JointCommand(velocity, position, np.where(self.driven, torque, np.nan)))
        return JointCommand(velocity, position), JointCommand(torque=1.0 * torque)

    @pytest.mark.parametrize("name", sorted(ACTUATORS))
    def test_each_joint_does_what_it_did_if_all_were_like_it(self, name, rng):
        both, servoed, driven = (of(ACTUATORS[name]) for _ in range(3))
        for made in (both, servoed, driven):
            made.reset(zeros, zeros)
        by_servo, by_torque = self.mixed(rng, both)
        servoed.command(by_servo)
        driven.command(by_torque)
        for _ in range(4):
            expected = np.where(
                self.driven, *(motor_torque(m, zeros, ones) for m in (driven, servoed))
            )
            np.testing.assert_array_equal(motor_torque(both, zeros, ones), expected)

    @pytest.mark.parametrize("name", sorted(ACTUATORS))
    def test_torque_control_of_all_can_follow(self, name, rng):
        """The loops of the others were not left behind, nor made undefined."""
        made = of(ACTUATORS[name])
        made.reset(zeros, zeros)
        self.mixed(rng, made)
        for _ in range(50):
            before = motor_torque(made, zeros, zeros)
        made.command(JointCommand(torque=made.drives.joint_torque.copy()))
        after = motor_torque(made, zeros, zeros)
        np.testing.assert_allclose(after, before, atol=2.0)

    def test_a_reset_forgets_it(self, rng):
        made = actuators()
        self.mixed(rng, made)
        made.reset(zeros, ones)
        np.testing.assert_allclose(motor_torque(made, zeros, zeros), ones)
        assert np.isnan(made.drives.torque_command).all()
