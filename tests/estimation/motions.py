"""Readings of made-up motions and of recorded jumps, with what is true of them."""

import copy
import dataclasses
import math

import numpy as np
import pinocchio as pin

from experiments.estimation_errors import Truth, WatchedEnv
from icub_jump_env.config import JumpConfig
from icub_jump_env.estimation.imu import ImuEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()
DT = 0.002
KINEMATICS = FeetFixedKinematics(ROBOT)
WEIGHT = 9.81 * KINEMATICS.mass
BOTH = (WEIGHT / 2, WEIGHT / 2)
DOWN = np.array([0.0, 0.0, -1.0])
TO_IMU = np.diag([-1.0, -1.0, 1.0])  # the base faces its own -x


class MadeUp:
    """A motion of base and joints as functions of time, and what ideal sensors say of it.

    Attributes:
        down: (3,) direction of gravity in the world.
    """

    def __init__(self, posture, base=None, down=DOWN):
        """Set up the motion.

        Args:
            posture: (n,) joints (rad) at a time (s).
            base: Orientation and position at a time; by default the left sole stands still.
            down: Direction of gravity in the world.
        """
        self.posture, self.down = posture, down
        self.base = base if base is not None else lambda t: standing(posture(t))

    def velocity(self, t, e=1e-5):
        """Of the base (m/s), world axes."""
        return (self.base(t + e)[1] - self.base(t - e)[1]) / (2 * e)

    def readings(self, t, force=BOTH, dt=DT, e=1e-5):
        """At a time; the accelerometer's mean is in the axes of the middle of the period."""
        R = self.base(t)[0]
        omega = pin.log3(self.base(t - e)[0].T @ self.base(t + e)[0]) / (2 * e)
        specific = (self.velocity(t) - self.velocity(t - dt)) / dt - 9.81 * self.down
        return Readings(
            {"n": ROBOT.n_joints},
            joint_position=self.posture(t),
            joint_velocity=(self.posture(t + e) - self.posture(t - e)) / (2 * e),
            gravity=TO_IMU @ R.T @ self.down,
            gyro=TO_IMU @ omega,
            accelerometer=TO_IMU @ self.base(t - dt / 2)[0].T @ specific,
            foot_force=np.array(force),
        )

    def momentum(self, t, e=1e-5):
        """CoM (m), its velocity (m/s) and the angular momentum, by Pinocchio."""
        kinematics = FeetFixedKinematics(ROBOT)
        (R, p), posture = self.base(t), self.posture(t)
        q = np.concatenate((p, pin.Quaternion(R).coeffs(), posture))
        readings = self.readings(t)
        twist = np.concatenate((R.T @ self.velocity(t), TO_IMU @ readings.gyro))
        data = kinematics.model.createData()
        nu = np.concatenate((twist, readings.joint_velocity))
        h = pin.computeCentroidalMomentum(kinematics.model, data, q, nu)
        return data.com[0].copy(), h.linear / kinematics.mass, h.angular.copy()


def standing(posture, foot=0):
    """Orientation and position of the base while one sole stands where it does in the crouch."""
    KINEMATICS.update(ROBOT.crouch)
    base = pin.SE3(KINEMATICS.base_rotation, KINEMATICS.base_position)
    ankle = base * KINEMATICS.base_M_ankles[foot]
    KINEMATICS.update(posture)
    base = ankle * KINEMATICS.base_M_ankles[foot].inverse()
    return base.rotation, base.translation


R0, P0 = standing(ROBOT.crouch)
REST = MadeUp(lambda t: ROBOT.crouch, lambda t: (R0, P0))
NONE = (0.0, 0.0)


def ticks(duration, start=0.0):
    return start + DT * np.arange(round(duration / DT))


def thrown(rate=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), wave=0.0):
    """From rest, at t = 0: the CoM flies freely, the base turns steadily, joints wave."""
    rate, velocity = np.array(rate), np.array(velocity)
    kinematics = FeetFixedKinematics(ROBOT)

    def posture(t):
        return ROBOT.crouch + wave * (1 - math.cos(6 * max(t, 0.0)))

    def base(t):
        later = max(t, 0.0)
        R = pin.exp3(later * rate) @ R0
        kinematics.update(ROBOT.crouch)
        com = P0 + R0 @ kinematics.base_p_com + velocity * later
        com[2] -= 9.81 / 2 * later**2
        kinematics.update(posture(t))
        return R, com - R @ kinematics.base_p_com

    return MadeUp(posture, base)


def estimator(dt=DT):
    return ImuEstimator(FeetFixedKinematics(ROBOT), dt)


def feed(estimator, motion, times, force=BOTH):
    """The state after the readings of these times."""
    for t in times:
        state = estimator.estimate(motion.readings(t, force))
    return state


def tilt(rotation, true):
    """Angle (deg) between two orientations, but for a turn about the vertical."""
    return np.degrees(np.linalg.norm(np.cross(rotation[2], true[2])))


@dataclasses.dataclass
class Tick:
    """One control tick of a recorded jump."""

    time: float
    readings: Readings
    truth: object


class Recorded:
    """A jump.

    Attributes:
        dt: Control period (s).
        ticks: All control ticks.
        takeoff: s.
        touchdown: s.
    """

    def __init__(self, seed=0, **config):
        env = WatchedEnv(**vars(JumpConfig.of(stand_time=0.4, **config)))
        self.dt, self.ticks = env.config.control_dt, []
        truth = Truth(env.model)

        def keep(readings):
            kept = copy.deepcopy(readings)
            self.ticks.append(Tick(env.data.time, kept, truth.read(env.data)))

        env.watch = keep
        env.reset(seed=seed)
        done = False
        while not done:
            *_, done, _, info = env.step(np.zeros(3, np.float32))
        self.takeoff = info["jump"]["takeoff_time"]
        self.touchdown = self.takeoff + info["jump"]["flight_time"]
        env.close()

    def states(self, estimator=None):
        """Each tick with a copy of what an estimator believes."""
        estimator = estimator or ImuEstimator(FeetFixedKinematics(ROBOT), self.dt)
        for tick in self.ticks:
            yield tick, copy.deepcopy(estimator.estimate(tick.readings))

    def flight(self, estimator=None):
        """Those in the air."""
        for tick, state in self.states(estimator):
            if self.takeoff + 0.01 < tick.time < self.touchdown - 0.005:
                yield tick, state
