"""The attitude against another filter, but for turns about the vertical."""

import numpy as np
import pinocchio as pin
import pytest
from motions import DT, NONE, P0, R0, ROBOT, TO_IMU, MadeUp, Recorded, estimator, feed, ticks, tilt


@pytest.fixture(scope="module", params=["velocity", "torque"])
def jump(request):
    return Recorded(controller=request.param)


class TestAgainstAnotherFilter:
    @staticmethod
    def filter(dt, gain, start):
        imufusion = pytest.importorskip("imufusion")
        ahrs = imufusion.Ahrs()
        ahrs.set_settings(imufusion.AhrsSettings(gain=gain))
        ahrs.set_sample_period(dt)
        ahrs.skip_startup()
        ahrs.set_quaternion(pin.Quaternion(start).coeffs()[[3, 0, 1, 2]])

        def update(readings):
            ahrs.update_no_magnetometer(np.degrees(readings.gyro), readings.accelerometer / 9.81)
            return imufusion.quaternion_to_matrix(ahrs.get_quaternion()) @ TO_IMU

        return update

    def test_of_a_made_up_motion(self, rng):
        """Both begin 3 deg off and end together, near the truth."""
        amplitude = 0.2 * rng.normal(size=3)

        def base(t):
            return pin.exp3(amplitude * np.sin(np.array([3.0, 4.0, 5.0]) * t)) @ R0, P0

        motion = MadeUp(lambda t: ROBOT.crouch, base)
        off = pin.exp3(np.array([0.04, 0.03, 0.0]))
        ours = estimator()
        feed(ours, motion, [0.0])
        feed(ours, motion, [DT], NONE)
        ours._state.base_rotation[:] = off @ ours._state.base_rotation
        other = self.filter(DT, 0.5, off @ base(DT)[0] @ TO_IMU)
        for t in ticks(4.0, 2 * DT):
            readings = motion.readings(t, NONE)
            state, theirs = ours.estimate(readings), other(readings)
            if t < 0.01:
                assert tilt(state.base_rotation, motion.base(t)[0]) > 2.0
        assert tilt(state.base_rotation, theirs) < 0.5
        assert tilt(state.base_rotation, motion.base(t)[0]) < 0.05

    def test_of_a_jump(self, jump):
        """Its gain is low: the accelerometer of a jump does not show the vertical."""
        other, turned = None, 0.0
        for tick, state in jump.states():
            if tick.time > jump.touchdown:
                break
            if other is None:
                other = self.filter(jump.dt, 0.01, state.base_rotation @ TO_IMU)
                continue
            turned = max(turned, tilt(state.base_rotation, R0))
            assert tilt(state.base_rotation, other(tick.readings)) < 0.5
        assert turned > 5.0
