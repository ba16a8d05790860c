"""The IMU estimator from touch-down on, and from one episode to the next."""

import copy
import math
import pickle

import numpy as np
import pinocchio as pin
import pytest
from conftest import ZERO, random_action
from motions import (
    NONE,
    P0,
    R0,
    REST,
    ROBOT,
    WEIGHT,
    MadeUp,
    Recorded,
    estimator,
    feed,
    thrown,
    ticks,
)

from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.estimation import imu
from icub_jump_env.simulation.randomization import Randomization


class TestTouchDown:
    def test_what_touches_first_is_on_the_floor(self):
        posture = ROBOT.crouch.copy()
        posture[ROBOT.left_leg] += [0.3, 0.0, 0.0, -0.5, 0.2, 0.0]  # its sole is higher
        lifted = MadeUp(lambda t: posture, base=lambda t: (R0, P0 + [0.0, 0.0, 0.1]))
        for first in (0, 1):
            ours = estimator()
            feed(ours, REST, ticks(0.1))
            feed(ours, REST, ticks(0.1), NONE)
            flying = feed(ours, lifted, [0.0], NONE)
            before, above = flying.sole_position.copy(), flying.com - flying.sole_position
            assert before[0, 2] > before[1, 2] + 0.01
            force = [0.2 * WEIGHT, 0.3 * WEIGHT] if first else [0.3 * WEIGHT, 0.2 * WEIGHT]
            state = feed(ours, lifted, [0.0], force)
            np.testing.assert_allclose(state.com - state.sole_position, above, atol=1e-4)
            heights = state.sole_position[:, 2]
            assert heights[first] == pytest.approx(0.0, abs=1e-9)
            assert heights[0] - heights[1] == pytest.approx(before[0, 2] - before[1, 2], abs=1e-4)
            # There they stand from now on.
            held = state.sole_position.copy()
            state = feed(ours, lifted, ticks(0.3), force)
            np.testing.assert_allclose(state.sole_position[first], held[first], atol=2e-3)

    def test_a_contact_that_goes_on_is_no_touch_down(self):
        ours = estimator()
        feed(ours, REST, ticks(0.1))
        feed(ours, REST, [0.0] * imu.LIFT_OFF_READINGS, NONE)
        feed(ours, REST, [0.0])
        ours._memory.base_position[2] += 0.01
        ours._memory.footholds[:, 2] += 0.01
        assert feed(ours, REST, ticks(0.1)).sole_position[0, 2] == pytest.approx(0.01, abs=1e-3)

    def test_a_single_reading_without_load_is_no_lift_off(self):
        """What was 1 cm off stays so, but for the correction of loaded soles, none here."""
        found = []
        for unloaded in (1, 2):
            ours = estimator()
            feed(ours, REST, ticks(0.1))
            ours._memory.base_position[2] += 0.01
            ours._memory.footholds[:, 2] += 0.01
            feed(ours, REST, [0.0] * unloaded, NONE)
            found.append(feed(ours, REST, [0.0]).sole_position[0, 2])
        assert found == pytest.approx([0.01, 0.0], abs=1e-4)

    def test_on_a_step_the_other_sole_stays_lower(self):
        """The floor, and with it the step, gives way by some millimetres."""
        step = Recorded(randomization=Randomization(step=(0.03, 0.03)))
        (tick, touched), *_, (later, stood) = [
            both for both in step.states() if 0.0 < both[0].time - step.touchdown < 0.1
        ]
        assert tick.truth.soles[0, 2] > 0.03
        assert touched.sole_position[0, 2] == pytest.approx(0.0, abs=1e-6)
        assert stood.sole_position[0, 2] == pytest.approx(0.0, abs=0.003)
        true = np.diff(later.truth.soles[:, 2])
        assert true < -0.015
        assert np.diff(stood.sole_position[:, 2]) == pytest.approx(true, abs=0.001)

    def test_a_turn_about_the_vertical_is_kept(self):
        motion = thrown((0.0, 0.0, 2.0))
        ours = estimator()
        feed(ours, REST, ticks(0.2))
        feed(ours, motion, ticks(0.1), NONE)
        R = pin.exp3(np.array([0.0, 0.0, 0.2])) @ R0
        still = MadeUp(lambda t: ROBOT.crouch, base=lambda t: (R, P0))
        state = feed(ours, still, ticks(1.0))
        assert np.degrees(np.linalg.norm(pin.log3(state.base_rotation.T @ R))) < 0.2
        soles = state.sole_position
        across = soles[0] - soles[1]
        assert math.atan2(-across[0], across[1]) == pytest.approx(0.2, abs=0.004)

    def test_a_tilt_left_by_the_flight_is_taken_back(self):
        ours = estimator()
        feed(ours, REST, ticks(0.1))
        feed(ours, REST, ticks(0.01), NONE)
        ours._state.base_rotation[:] = pin.exp3(np.array([0.01, -0.01, 0.1])) @ R0
        state = feed(ours, REST, ticks(2.0))
        turn = pin.log3(state.base_rotation @ R0.T)
        np.testing.assert_allclose(turn[:2], 0.0, atol=1e-4)
        assert turn[2] == pytest.approx(0.1, abs=1e-3)


class TestSameBits:
    def test_reset_forgets_everything(self):
        jump = Recorded(randomization="hard", sensors="realistic", estimator="imu")
        ours = estimator(jump.dt)
        runs = [[state for _, state in jump.states(ours)]]
        ours.reset()
        runs.append([state for _, state in jump.states(ours)])
        for first, second in zip(*runs, strict=True):
            assert first.block.tobytes() == second.block.tobytes()

    @pytest.mark.parametrize(
        "copier", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]
    )
    def test_a_copy_goes_on_in_mid_flight(self, copier):
        env = ICubJumpEnv(estimator="imu", randomization="full", stand_time=0.1)
        env.reset(seed=0)
        while env.step(ZERO)[4]["phase"] != "flight":
            pass
        env.step(ZERO)
        twin, rng, done = copier(env), np.random.default_rng(0), False
        assert env._state.block.tobytes() == twin._state.block.tobytes()
        while not done:
            action = random_action(rng)
            ours, theirs = env.step(action), twin.step(action)
            np.testing.assert_array_equal(ours[0], theirs[0])
            np.testing.assert_array_equal(env.data.qpos, twin.data.qpos)
            done = ours[2]
        assert ours[4]["jump"] == theirs[4]["jump"]

    def test_the_same_seed_gives_the_same_jump(self):
        env = ICubJumpEnv(estimator="imu", randomization="full", stand_time=0.1)
        ends = []
        for seed in (1, 2, 1):
            env.reset(seed=seed)
            while not env.step(ZERO)[2]:
                pass
            ends.append(env.data.qpos.copy())
        np.testing.assert_array_equal(ends[0], ends[2])
        assert not np.array_equal(ends[0], ends[1])

    def test_refreshing_takes_no_time(self):
        ours = estimator()
        state = feed(ours, thrown((0.0, 1.0, 0.0)), ticks(0.1))
        before = state.block.tobytes()
        readings = REST.readings(0.0)
        ours._kinematics.update(ROBOT.landing)
        again = ours.refresh(readings)
        assert again.block.tobytes() == before
        com = ours._kinematics.com.copy()
        ours._kinematics.update(state.joint_position)
        np.testing.assert_array_equal(ours._kinematics.com, com)
