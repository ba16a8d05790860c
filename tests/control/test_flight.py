"""The flight that places the soles by feedback, on states made up in the air."""

import numpy as np
import pinocchio as pin
import pytest
from standing import ROBOT, STANCE, N

from icub_jump_env.control import flight as flight_module
from icub_jump_env.control.flight import FeedbackFlight, MinimumJerkFlight
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.residual import N_AXES, ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlan, plan_com_trajectory
from icub_jump_env.robot.kinematics import FeetFixedKinematics

DT = 0.005
PLAN = ScaledCurvePlan(plan_com_trajectory(0.04), ROBOT, STANCE)
KINEMATICS = FeetFixedKinematics(ROBOT)
KINEMATICS.update(ROBOT.landing)
UPRIGHT = KINEMATICS.base_rotation.copy()
REST = KINEMATICS.com - KINEMATICS.sole_positions.mean(axis=0)
NOTHING = np.zeros(N_AXES)


def in_the_air(**values) -> RobotState:
    """High above the ground and rising, so that it is far from touch-down."""
    high_and_rising = {
        "joint_position": ROBOT.landing,
        "base_rotation": UPRIGHT,
        "com": (0.0, 0.0, 1.5),
        "com_velocity": (0.0, 0.0, 0.5),
        "gravity": (0.0, 0.0, -1.0),
    }
    return RobotState({"n": N}, **(high_and_rising | values))


def fly(state, ticks=120, target=NOTHING, flight=None):
    """A flight long after its motion ended, and its last command."""
    if flight is None:
        flight = FeedbackFlight(ResidualFilter(15.0), DT, FeetFixedKinematics(ROBOT))
        flight.start(state, PLAN, 1.0)
    for k in range(ticks):
        tick = flight.tick(state, 1.0 + k * DT, target)
    assert tick.report is None
    return flight, tick.command


def soles(command, rotation=UPRIGHT):
    """Middles of the soles from the CoM, and their orientations, in the world."""
    there = FeetFixedKinematics(ROBOT)
    there.update(command.position)
    ankles, points = there.base_M_ankles, there.ankle_p_soles
    positions = [ankle.act(p) - there.base_p_com for ankle, p in zip(ankles, points, strict=True)]
    # The sole frames have the axes of the ankles.
    return positions @ rotation.T, [rotation @ ankle.rotation for ankle in ankles]


def test_without_anything_to_correct_it_is_the_minimum_jerk():
    state = in_the_air()
    state.joint_position[:] = ROBOT.landing + 0.6 * (ROBOT.crouch - ROBOT.landing)
    paper = MinimumJerkFlight(ResidualFilter(15.0), DT, None)
    paper.start(state, PLAN, 1.0)
    ours = FeedbackFlight(ResidualFilter(15.0), DT, FeetFixedKinematics(ROBOT))
    ours.start(state, PLAN, 1.0)
    for k in range(40):
        expected = paper.tick(state, 1.0 + k * DT, NOTHING).command
        command = ours.tick(state, 1.0 + k * DT, NOTHING).command
        np.testing.assert_allclose(command.velocity, expected.velocity, atol=0.02)
        ahead = expected.position + flight_module.LAG * expected.velocity
        np.testing.assert_allclose(command.position, ahead, atol=1e-3)


@pytest.mark.parametrize("turn", [(0.0, 0.15, 0.0), (0.05, -0.2, 0.0), (0.0, 0.1, 0.4)])
def test_soles_are_level_whatever_the_attitude(turn):
    """They turn with the robot about the vertical alone."""
    rotation = pin.exp3(np.array([0.0, 0.0, turn[2]])) @ pin.exp3(np.array(turn)) @ UPRIGHT
    _, command = fly(in_the_air(base_rotation=rotation))
    positions, orientations = soles(command, rotation)
    for orientation in orientations:
        np.testing.assert_allclose(orientation[:, 2], [0, 0, 1], atol=2e-3)
    forward, robot_forward = orientations[0][:2, 0], -rotation[:2, 0]
    robot_forward /= np.linalg.norm(robot_forward)
    np.testing.assert_allclose(forward, robot_forward, atol=2e-3)
    np.testing.assert_allclose(positions[:, 2], -REST[2], atol=2e-3)


def test_the_attitude_is_predicted_as_of_one_rigid_body():
    """Not from the angular velocity of the base, half of which is the echo of the legs."""
    inertia = UPRIGHT @ KINEMATICS.A_base[3:, 3:] @ UPRIGHT.T
    rate = np.array([0.2, 0.8, 0.0])
    state = in_the_air(angular_momentum=inertia @ rate, angular_velocity=np.array([3.0, 2.0, 1.0]))
    _, command = fly(state)
    ahead = pin.exp3(flight_module.LEAD * rate) @ UPRIGHT
    _, orientations = soles(command, ahead)
    np.testing.assert_allclose(orientations[0][:, 2], [0, 0, 1], atol=1e-3)


@pytest.mark.parametrize("velocity", [(0.15, 0.0), (-0.1, 0.0), (0.0, 0.05), (0.0, -0.05)])
def test_soles_are_placed_below_the_capture_point(velocity):
    state = in_the_air()
    state.com_velocity[:2] = velocity
    flight, command = fly(state)
    positions, _ = soles(command)
    below = np.array(velocity) * np.sqrt(REST[2] / 9.81) - REST[:2]
    np.testing.assert_allclose(positions.mean(axis=0)[:2], below, atol=2e-3)
    np.testing.assert_allclose(flight.setpoint.com_position[:2], -below, atol=1e-6)


@pytest.mark.parametrize("yaw", [-0.6, 0.3])
def test_who_has_turned_about_the_vertical_places_the_soles_along_the_heading(yaw):
    turn = pin.exp3(np.array([0.0, 0.0, yaw]))
    speeds, momentum = np.array([0.2, 0.05, 0.5]), np.array([0.2, 0.3, 0.0])
    straight, _ = fly(in_the_air(com_velocity=speeds, angular_momentum=momentum))
    turned, command = fly(
        in_the_air(
            base_rotation=turn @ UPRIGHT,
            com_velocity=turn @ speeds,
            angular_momentum=turn @ momentum,
        )
    )
    wanted = straight.setpoint.com_position
    np.testing.assert_allclose(turned.setpoint.com_position, wanted, atol=1e-9)
    positions, _ = soles(command, turn @ UPRIGHT)
    np.testing.assert_allclose(positions.mean(axis=0)[:2], -(turn @ wanted)[:2], atol=2e-3)


def test_angular_momentum_counts_like_the_speed_it_will_become():
    """A robot that pitches forward will fall forward."""
    placed = []
    for momentum in ((0.0, 0.8, 0.0), (0.0, -0.8, 0.0), (-0.5, 0.0, 0.0)):
        flight, _ = fly(in_the_air(angular_momentum=np.array(momentum)))
        placed.append(REST - flight.setpoint.com_position)
    share = flight_module.MOMENTUM_SHARE / (KINEMATICS.mass * REST[2]) * np.sqrt(REST[2] / 9.81)
    assert placed[0][0] == pytest.approx(0.8 * share)
    assert placed[1][0] == pytest.approx(-0.8 * share)
    assert placed[2][1] == pytest.approx(0.5 * share)


def test_placement_and_speeds_and_positions_are_bounded():
    state = in_the_air(com_velocity=np.array([3.0, -2.0, 0.5]))
    state.joint_position[:] = ROBOT.crouch
    flight = FeedbackFlight(ResidualFilter(15.0), DT, FeetFixedKinematics(ROBOT))
    flight.start(state, PLAN, 1.0)
    last = None
    for k in range(120):
        _, command = fly(state, 1, flight=flight)
        if last is not None and k > 30:
            speed = np.abs(command.position - last)[:12] / DT
            assert (speed <= ROBOT.velocity_limit[:12]).all()
        last = command.position
        assert (np.abs(command.velocity) <= ROBOT.velocity_limit).all()
    np.testing.assert_allclose(
        flight.setpoint.com_position[:2], REST[:2] - [0.09, -0.03], atol=1e-6
    )
    assert (last >= ROBOT.lower_position).all()
    assert (last <= ROBOT.upper_position).all()


def falling(time, landing_at=0.2):
    """A state ``time`` (s) before which the legs as they are touch the floor at 0.2 s."""
    left = landing_at - time
    speed = -1.0 + 9.81 * left
    height = REST[2] + 1.0 * left - 9.81 / 2 * left**2
    return in_the_air(com=np.array([0.0, 0.0, height]), com_velocity=np.array([0.0, 0.0, speed]))


def reach(backward=0.0, momentum=0.0):
    """Length of the legs (m, over that of the landing posture) until touch-down is due."""
    flight = FeedbackFlight(ResidualFilter(15.0), DT, FeetFixedKinematics(ROBOT))
    flight.start(in_the_air(), PLAN, -1.0)
    lengths, yields = [], []
    for k in range(60):
        state = falling(k * DT - 0.05)
        state.com_velocity[0] = -backward
        state.angular_momentum[1] = momentum
        flight.tick(state, k * DT - 0.05, NOTHING)
        lengths.append(flight.setpoint.com_position[2] - REST[2])
        yields.append(flight.yielding)
    return np.array(lengths), np.array(yields)


def test_legs_reach_for_the_ground_and_give_way_when_it_comes():
    lengths, yields = reach()
    assert lengths[0] == 0.0
    assert lengths.max() == pytest.approx(flight_module.EXTENSION, rel=0.1)
    peak = int(lengths.argmax())
    assert 0.0 < peak * DT - 0.05 < 0.2
    assert (np.diff(lengths[peak:]) <= 1e-12).all()
    assert yields.max() == pytest.approx(flight_module.YIELD_SHARE, rel=0.15)
    # If the ground does not come they stop.
    assert yields[-1] == 0.0
    assert flight_module.EXTENSION - lengths[-1] == pytest.approx(
        flight_module.FARTHEST_YIELD, abs=0.01
    )


@pytest.mark.parametrize("disturbed", [{"momentum": 0.5}, {"momentum": -0.5}, {"backward": 0.15}])
def test_only_a_calm_robot_waits_with_extended_legs(disturbed):
    (calm, _), (hurried, _) = reach(), reach(**disturbed)
    wait = round(flight_module.OVERSHOOT_TIME / DT)
    assert wait > 0
    begins = [int(np.flatnonzero(lengths > 0.0)[0]) for lengths in (calm, hurried)]
    assert begins[1] - begins[0] == wait


def test_legs_do_not_give_way_where_the_soles_are_far_behind():
    lengths, yields = reach(backward=0.2)
    assert lengths.max() == pytest.approx(flight_module.EXTENSION)
    assert not yields.any()


def test_a_residual_moves_the_com_over_the_soles():
    target = np.array([0.02, -0.01, 0.01])
    flight, command = fly(in_the_air(), 300, np.array([*target, 0.0, 0.0]))
    positions, _ = soles(command)
    np.testing.assert_allclose(positions.mean(axis=0), -(REST + target), atol=2e-3)
    np.testing.assert_allclose(flight.setpoint.com_position, REST + target, atol=1e-4)


def test_after_touch_down_it_goes_on_to_where_it_was_going():
    state = in_the_air()
    state.joint_position[:] = ROBOT.crouch
    state.com_velocity[0] = 0.2
    flight = FeedbackFlight(ResidualFilter(15.0), DT, FeetFixedKinematics(ROBOT))
    flight.start(state, PLAN, 1.0)
    for k in range(10):
        last = flight.tick(state, 1.0 + k * DT, NOTHING).command
    posture = flight._motion.posture.copy()
    first = flight.go_on(1.05, NOTHING).command
    assert np.abs(first.position - last.position).max() < 2 * DT * np.abs(last.velocity).max()
    command = flight.go_on(2.0, NOTHING).command
    np.testing.assert_allclose(command.position, posture)
    np.testing.assert_array_equal(command.velocity, 0.0)


def test_the_next_flight_forgets():
    used, _ = fly(in_the_air(com_velocity=np.array([0.3, 0.1, -0.8]), com=np.array([0, 0, 0.5])))
    used.start(in_the_air(), PLAN, 1.0)
    _, again = fly(in_the_air(), 20, flight=used)
    _, fresh = fly(in_the_air(), 20)
    np.testing.assert_array_equal(again.position, fresh.position)
    np.testing.assert_array_equal(again.velocity, fresh.velocity)
