"""The IMU estimator on the feet and in the air, against the truth."""

import math

import numpy as np
import pinocchio as pin
import pytest
from motions import (
    BOTH,
    DOWN,
    DT,
    NONE,
    P0,
    R0,
    REST,
    ROBOT,
    TO_IMU,
    WEIGHT,
    MadeUp,
    Recorded,
    estimator,
    feed,
    standing,
    thrown,
    ticks,
    tilt,
)

from icub_jump_env.estimation import imu
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.simulation.randomization import Randomization


@pytest.fixture(scope="module", params=["velocity", "torque"])
def jump(request):
    return Recorded(controller=request.param)


class TestOnTheFeet:
    def test_at_rest_it_is_the_feet_fixed_one(self):
        theirs = FeetFixedEstimator(FeetFixedKinematics(ROBOT)).estimate(REST.readings(0.0))
        ours = feed(estimator(), REST, ticks(0.4))
        np.testing.assert_allclose(ours.sole_position, theirs.sole_position, atol=2e-4)
        np.testing.assert_allclose(ours.sole_position[0], theirs.sole_position[0], atol=1e-9)
        for name in ("base_rotation", "com", "gravity", "joint_position"):
            np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), atol=1e-9)
        for name in ("com_velocity", "angular_momentum", "angular_velocity"):
            np.testing.assert_allclose(getattr(ours, name), 0.0, atol=1e-9)
        np.testing.assert_array_equal(ours.foot_force, BOTH)

    def test_in_the_launch_it_stays_near_the_feet_fixed_one(self, jump):
        theirs = FeetFixedEstimator(FeetFixedKinematics(ROBOT))
        for tick, state in jump.states():
            if tick.time > jump.takeoff - 0.03:
                break
            other = theirs.estimate(tick.readings)
            assert tilt(state.base_rotation, other.base_rotation) < 0.1
            assert np.linalg.norm(state.com - other.com) < 0.002
            assert np.linalg.norm(state.sole_position - other.sole_position) < 0.002
            assert np.linalg.norm(state.com_velocity - other.com_velocity) < 0.03
            assert np.linalg.norm(state.angular_momentum - other.angular_momentum) < 0.02

    def test_velocity_and_momentum_are_those_of_a_moving_body(self):
        motion = MadeUp(lambda t: ROBOT.crouch + 0.05 * np.sin(3 * t + np.arange(ROBOT.n_joints)))
        com, velocity, momentum = motion.momentum(0.5 - DT)
        assert np.linalg.norm(velocity) > 0.02
        assert np.linalg.norm(momentum) > 0.1
        # The right sole moves.
        left = feed(estimator(), motion, ticks(0.5), (WEIGHT, 0.0))
        np.testing.assert_allclose(left.com, com, atol=2e-4)
        np.testing.assert_allclose(left.com_velocity, velocity, atol=1e-4)
        np.testing.assert_allclose(left.angular_momentum, momentum, atol=1e-3)
        omega = motion.base(0.5 - DT)[0] @ TO_IMU @ motion.readings(0.5 - DT).gyro
        np.testing.assert_allclose(left.angular_velocity, omega, atol=1e-6)

    @pytest.mark.parametrize("force", [(0.95, 0.05), (0.95, -0.05), (0.3, 0.0)])
    @pytest.mark.parametrize("foot", [0, 1])
    def test_a_sole_without_load_says_nothing_and_the_other_all(self, force, foot):
        """The base moves steadily and nothing but one leg says so."""
        leg = (ROBOT.left_leg, ROBOT.right_leg)[foot]
        speed = np.zeros(ROBOT.n_joints)
        speed[leg] = 0.1 * np.array([1.0, 0.2, 0.0, -1.0, -0.5, 0.1])
        motion = MadeUp(lambda t: ROBOT.crouch + t * speed)
        motion.base = lambda t: standing(motion.posture(t), foot)
        ours = estimator()
        for t in ticks(0.3):
            readings = motion.readings(t, WEIGHT * np.array(force)[[foot, 1 - foot]])
            readings.accelerometer = -9.81 * readings.gravity
            state = ours.estimate(readings)
        com, velocity, _ = motion.momentum(0.3 - DT)
        assert np.linalg.norm(velocity) > 0.015
        np.testing.assert_allclose(state.com_velocity, velocity, atol=2e-3)
        np.testing.assert_allclose(state.com, com, atol=1e-3)

    def test_a_drift_of_the_position_is_taken_back(self):
        ours = estimator()
        feed(ours, REST, ticks(0.1))
        ours._memory.base_position += [0.01, 0.02, 0.03]
        state = feed(ours, REST, ticks(0.4))
        np.testing.assert_allclose(state.com, REST.momentum(0.0)[0], atol=1e-6)

    def test_how_fast_soles_correct(self):
        ours = estimator()
        feed(ours, REST, ticks(0.1))
        for force, load in ((BOTH, 1.0), ((0.1 * WEIGHT, 0.1 * WEIGHT), 0.5)):
            ours._memory.base_velocity[:] = 1.0, 0.0, 0.0
            ours._memory.base_position[:] = ours_at_rest = P0.copy()
            state = ours.estimate(REST.readings(0.0, force))
            left = math.exp(-imu.CONTACT_GAIN * load * DT)
            assert state.com_velocity[0] == pytest.approx(left, abs=1e-9)
            moved = ours._memory.base_position[0] - ours_at_rest[0]
            assert moved == pytest.approx(left * DT, abs=1e-9)
            assert state.sole_position[0, 0] == pytest.approx(ROBOT.sole.center_x + moved)

    def test_how_fast_a_flat_sole_corrects_the_attitude(self):
        ours = estimator()
        feed(ours, REST, ticks(0.1))
        small = np.array([0.0, 0.001, 0.0])
        flatness = math.exp(-((0.001 / imu.FLATNESS) ** 2))
        for force, load in (
            (BOTH, 1.0), ((0.1 * WEIGHT, 0.9 * WEIGHT), 0.5), ((0.0, WEIGHT), 0.0),
        ):  # fmt: skip
            ours._state.base_rotation[:] = pin.exp3(small) @ R0
            flat = load * flatness
            turned = feed(ours, REST, [0.0], force).base_rotation @ R0.T
            taken = 2.0 - math.exp(-imu.FLAT_GAIN * flat * DT)
            taken -= math.exp(-imu.TILT_GAIN * (1.0 - flat) * DT)
            assert pin.log3(turned)[1] / 0.001 == pytest.approx(1.0 - taken, abs=1e-6)

    def test_a_sole_that_rolls_over_an_edge_does_not_turn_the_attitude(self):
        """In half a second the left one rolls by 15 deg, while the base stays where it was."""
        motion = MadeUp(lambda t: ROBOT.crouch + rolling(t), base=lambda t: (R0, P0))
        ours, worst = estimator(), 0.0
        feed(ours, REST, ticks(0.2))
        for force in (BOTH, NONE, (0.9 * WEIGHT, 0.1 * WEIGHT)):
            # In launch and after a landing alike.
            for t in ticks(0.5):
                state = feed(ours, motion, [t], force)
                worst = max(worst, tilt(state.base_rotation, R0))
        assert 0.01 < worst < 1.0

    def test_an_unloaded_sole_does_not_turn_the_attitude(self):
        motion = MadeUp(lambda t: ROBOT.crouch + rolling(t), base=lambda t: (R0, P0))
        ours = estimator()
        feed(ours, REST, ticks(0.2))
        state = feed(ours, motion, ticks(0.5), (0.04 * WEIGHT, 0.96 * WEIGHT))
        np.testing.assert_allclose(state.base_rotation, R0, atol=1e-9)
        np.testing.assert_allclose(
            state.com_velocity[:2], motion.momentum(0.498)[1][:2], atol=1e-4
        )
        # Where it came down it stands from now on.
        moved = state.sole_position[0].copy()
        still = MadeUp(lambda t: motion.posture(0.498), base=lambda t: (R0, P0))
        state = feed(ours, still, ticks(0.3), (0.15 * WEIGHT, 0.85 * WEIGHT))
        np.testing.assert_allclose(state.sole_position[0], moved, atol=1e-4)


def rolling(t):
    """(n,) what rolls the left ankle by 30 deg/s."""
    posture = np.zeros(ROBOT.n_joints)
    posture[ROBOT.left_leg.stop - 1] = math.radians(30.0) * max(t, 0.0)
    return posture


class TestGravity:
    @pytest.mark.parametrize("config", [{"slope": 0.03}, {"lateral_slope": -0.02}])
    def test_of_a_slope_is_learned_and_the_soles_stay_on_the_floor(self, config):
        world = Randomization(**{name: (value, value) for name, value in config.items()})
        jump = Recorded(randomization=world)
        down = np.array([-math.sin(world.slope[0]), -math.sin(world.lateral_slope[0]), 0.0])
        for tick, state in jump.states():
            np.testing.assert_allclose(state.gravity[:2], down[:2], atol=3e-3)
            assert np.linalg.norm(state.gravity) == pytest.approx(1.0)
            if tick.time < jump.takeoff - 0.03:
                np.testing.assert_allclose(state.sole_position[:, 2], 0.0, atol=1e-3)
                assert tilt(state.base_rotation, tick.truth.rotation) < 0.15
        flown = [tilt(s.base_rotation, tick.truth.rotation) for tick, s in jump.flight()]
        assert max(flown) < 0.3

    def test_under_encoder_bias_the_soles_stay_level_with_the_floor(self):
        """What makes the kinematics tilt, tilts the world with it."""
        bias = np.zeros(ROBOT.n_joints)
        bias[ROBOT.left_leg.stop - 2] = bias[ROBOT.right_leg.stop - 2] = 0.02
        R, p = standing(ROBOT.crouch)
        motion = MadeUp(lambda t: ROBOT.crouch + bias, base=lambda t: (R, p))
        state = feed(estimator(), motion, ticks(0.5))
        believed = standing(ROBOT.crouch + bias)[0]
        np.testing.assert_allclose(state.base_rotation, believed, atol=1e-9)
        np.testing.assert_allclose(state.gravity, believed @ R.T @ DOWN, atol=1e-9)
        assert abs(state.gravity[0]) == pytest.approx(0.02, abs=1e-4)
        np.testing.assert_allclose(state.sole_position[:, 2], 0.0, atol=2e-4)

    def test_it_is_a_mean_that_forgets_and_ends_with_the_lift_off(self):
        tilted = MadeUp(lambda t: ROBOT.crouch, down=pin.exp3(np.array([0.0, 0.1, 0.0])) @ DOWN)
        ours = estimator()
        feed(ours, REST, DT * np.arange(3))
        state = feed(ours, tilted, [0.0])
        assert state.gravity[0] == pytest.approx(tilted.down[0] / 4, rel=0.01)
        assert np.linalg.norm(state.gravity) == pytest.approx(1.0, abs=1e-9)
        feed(ours, REST, ticks(1.0))
        before = ours._state.gravity[0]
        state = feed(ours, tilted, [0.0])
        expected = before + (tilted.down[0] - before) / imu.AVERAGED
        assert state.gravity[0] == pytest.approx(expected, rel=0.01)
        feed(ours, REST, ticks(0.01), NONE)
        known = ours._state.gravity.copy()
        for force in (NONE, BOTH):
            state = feed(ours, tilted, ticks(0.02), force)
            np.testing.assert_array_equal(state.gravity, known)


class TestInTheAir:
    def test_the_base_is_where_gyro_and_accelerometer_put_it(self):
        """Whatever the joints and the other corrections do."""
        turn = np.array([0.1, 0.5, 0.2])

        def base(t):
            return pin.exp3((1 - math.cos(6 * t)) * turn) @ R0, P0 + np.array(
                [5.0, -2.0, 1.0]
            ) * t**2

        motion, ours = MadeUp(lambda t: ROBOT.crouch, base), estimator()
        feed(ours, motion, ticks(0.3), NONE)
        t = 0.3 - DT
        np.testing.assert_allclose(ours._memory.base_velocity, motion.velocity(t), atol=2e-3)
        np.testing.assert_allclose(ours._memory.base_position, base(t)[1], atol=5e-4)
        np.testing.assert_allclose(ours._state.base_rotation, base(t)[0], atol=2e-5)

    def test_a_made_up_flight_is_followed(self):
        motion = thrown((0.3, 2.0, -0.5), (0.4, -0.1, 1.5))
        ours = estimator()
        feed(ours, REST, ticks(0.2))
        # The throw happens within one period, which the accelerometer feels.
        state = feed(ours, motion, DT * np.arange(150), NONE)
        t = 149 * DT
        com, velocity, momentum = motion.momentum(t)
        assert (
            np.degrees(np.linalg.norm(pin.log3(state.base_rotation.T @ motion.base(t)[0]))) < 0.1
        )
        np.testing.assert_allclose(state.com_velocity, velocity, atol=5e-3)
        np.testing.assert_allclose(state.angular_momentum, momentum, atol=0.02)
        np.testing.assert_allclose(state.com, com, atol=3e-3)

    def test_joints_do_not_move_the_com(self):
        """What they do to the base, the accelerometer and they themselves say."""
        motion = thrown(velocity=(0.0, 0.0, 1.5), wave=0.1 * np.sin(np.arange(ROBOT.n_joints)))
        ours = estimator()
        feed(ours, REST, ticks(0.2))
        for t in DT * np.arange(150):
            state = feed(ours, motion, [t], NONE)
            if t > 0.15:
                np.testing.assert_allclose(state.com_velocity, motion.momentum(t)[1], atol=5e-3)
        np.testing.assert_allclose(state.com, motion.momentum(t)[0], atol=3e-3)

    def test_a_jump_is_followed(self, jump):
        """The attitude is that of 1 ms ago, as the gyro is."""
        worst = np.zeros(5)
        for tick, state in jump.flight():
            truth = tick.truth
            soles = state.sole_position - state.com - truth.soles + truth.com
            errors = [
                tilt(state.base_rotation, truth.rotation),
                np.linalg.norm(state.com_velocity - truth.com_velocity),
                np.linalg.norm(state.angular_momentum - truth.angular_momentum),
                np.linalg.norm(soles, axis=1).max(),
                np.linalg.norm(state.sole_position - truth.soles, axis=1).max(),
            ]
            worst = np.maximum(worst, errors)
        assert (worst < [0.2, 0.07, 0.15, 0.003, 0.008]).all(), worst

    def test_without_a_push_momentum_stays(self, jump):
        # From 50 ms on: what the lift-off left is corrected by then.
        found = np.array(
            [s.angular_momentum for tick, s in jump.flight() if tick.time > jump.takeoff + 0.05]
        )
        assert len(found) > 10
        assert np.ptp(found, axis=0).max() < 0.1
        assert np.ptp(found[len(found) // 2 :], axis=0).max() < 0.03

    def test_with_a_push_momentum_follows(self):
        push = Randomization(flight_push=(3.0, 3.0), flight_push_time=(0.03, 0.03))
        jump = Recorded(randomization=push)
        found = list(jump.flight())
        before, after = (
            next((tick, s) for tick, s in found if tick.time > jump.takeoff + t)
            for t in (0.025, 0.12)
        )
        gained = after[1].com_velocity - before[1].com_velocity
        assert gained[0] == pytest.approx(3.0 / FeetFixedKinematics(ROBOT).mass, abs=0.015)
        H = [s.angular_momentum for _, s in (before, after)]
        true = [tick.truth.angular_momentum for tick, _ in (before, after)]
        assert np.linalg.norm(true[1] - true[0]) > 0.3
        np.testing.assert_allclose(H[1] - H[0], true[1] - true[0], atol=0.1)

    def test_how_fast_free_fall_is_corrected(self):
        ours = estimator()
        feed(ours, REST, ticks(0.1))
        feed(ours, thrown(), [0.0], NONE)
        before = ours._state.com_velocity.copy(), ours._state.angular_momentum.copy()
        ours._memory.base_velocity[:] = 1.0, 0.0, 0.0
        readings = thrown().readings(0.1, NONE)
        readings.gyro[:] = 0.0, 0.1, 0.0
        state = ours.estimate(readings)
        taken = 1.0 - math.exp(-imu.BALLISTIC_GAIN * DT)
        # Half a turn of the base's x axis is forward; the CoM moves with the base.
        assert state.com_velocity[0] == pytest.approx(
            before[0][0] + taken * (1.0 + com_lever() - before[0][0]), abs=1e-3
        )
        assert state.com_velocity[2] == pytest.approx(
            before[0][2] - 9.81 * DT * (1.0 - taken) - taken * 9.81 * DT, abs=5e-3
        )
        full = 0.1 * locked_inertia()
        assert state.angular_momentum[1] == pytest.approx(before[1][1] + taken * full, rel=1e-2)


def com_lever():
    """Forward speed of the CoM from a base that turns by 0.1 rad/s about +y."""
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(ROBOT.crouch)
    return float(np.cross([0.0, 0.1, 0.0], R0 @ kinematics.base_p_com)[0])


def locked_inertia():
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(ROBOT.crouch)
    return kinematics.A_base[4, 4]
