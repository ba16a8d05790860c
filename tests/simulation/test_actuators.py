"""Joint servos: limits, tracking, no wind-up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.command import JointCommand
from icub_jump_env.errors import ConfigError
from icub_jump_env.robot import facts
from icub_jump_env.simulation.actuators import JointServo, ServoGains

DT = 0.001
N = facts.N_JOINTS
zeros = np.zeros(N)
vectors = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).normal(size=N))


@given(vectors, vectors, vectors, st.floats(0.0, 50.0))
def test_torque_stays_within_the_limits(position, velocity, command, size):
    servo = JointServo(DT)
    servo.reset(zeros, zeros)
    servo.command(JointCommand(size * command))
    for _ in range(5):
        torque = servo.torque(size * position, size * velocity)
        assert (np.abs(torque) <= facts.EFFORT_LIMIT).all()


@given(st.floats(0.0, 1.0))
def test_no_torque_drives_a_joint_beyond_its_top_speed(share):
    """At 1.03 x the speed limit the torque in the direction of motion is gone."""
    servo = JointServo(DT)
    servo.reset(zeros, zeros)
    servo.command(JointCommand(10 * facts.VELOCITY_LIMIT))
    speed = facts.VELOCITY_LIMIT * (1.0 + 0.03 * share)
    torque = servo.torque(zeros, speed)
    np.testing.assert_allclose(torque, facts.EFFORT_LIMIT * (1 - share), atol=1e-9)
    assert (servo.torque(zeros, 1.05 * facts.VELOCITY_LIMIT) < 0).all()


def test_reset_holds_with_the_given_torque(rng):
    torque = 0.5 * facts.EFFORT_LIMIT * rng.uniform(-1, 1, N)
    servo = JointServo(DT)
    servo.reset(facts.CROUCH, torque)
    np.testing.assert_allclose(servo.torque(facts.CROUCH, zeros), torque, atol=1e-9)


def test_velocity_command_is_tracked_without_offset(rng):
    """A joint of known inertia under a constant load reaches the commanded velocity."""
    inertia, load = facts.ARMATURE + 0.05, 0.3 * facts.EFFORT_LIMIT
    goal = 0.3 * facts.VELOCITY_LIMIT * np.sign(rng.normal(size=N))
    servo = JointServo(DT)
    servo.reset(zeros, zeros)
    servo.command(JointCommand(goal))
    s, s_dot = np.zeros(N), np.zeros(N)
    for _ in range(1500):
        s_dot = s_dot + DT * (servo.torque(s, s_dot) - load) / inertia
        s = s + DT * s_dot
    np.testing.assert_allclose(s_dot, goal, atol=1e-3)


def test_position_command_replaces_the_reference():
    servo = JointServo(DT)
    servo.reset(zeros, zeros)
    servo.command(JointCommand(zeros, position=np.full(N, 0.001)))
    stiffness = ServoGains().stiffness
    np.testing.assert_allclose(servo.torque(zeros, zeros), 0.001 * stiffness)


def test_does_not_wind_up():
    """After a long time against a stop, reversing the command acts at once."""
    servo = JointServo(DT)
    servo.reset(zeros, zeros)
    servo.command(JointCommand(facts.VELOCITY_LIMIT))
    for _ in range(3000):
        torque = servo.torque(zeros, zeros)
    np.testing.assert_allclose(torque, facts.EFFORT_LIMIT)
    servo.command(JointCommand(-facts.VELOCITY_LIMIT))
    steps = next(i for i in range(100) if (servo.torque(zeros, zeros) < 0).all())
    assert steps * DT <= 0.02


@pytest.mark.parametrize("values", [{"stiffness": 0.0}, {"damping": -1.0}, {"speed_band": 0.0}])
def test_bad_gains_are_refused(values):
    with pytest.raises(ConfigError) as refusal:
        ServoGains(**values)
    assert refusal.value.field in values


def test_reset_forgets_the_command():
    servo = JointServo(DT)
    servo.command(JointCommand(facts.VELOCITY_LIMIT))
    servo.reset(zeros, zeros)
    assert not servo.velocity_command.any()
    assert not servo.torque(zeros, zeros).any()
