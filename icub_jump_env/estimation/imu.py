"""The state through all phases of a jump: kinematics on the feet, IMU in the air.

On the ground the soles stand still as far as they are loaded, which gives velocity and
position of the base from the encoders; while the left one is flat, too, also its attitude. In
the air the gyro turns the attitude on, the CoM falls freely, and accelerometer and joints say
where it does not. At touch-down the soles are on the ground again.

World frame: that of :class:`icub_jump_env.robot.kinematics.FeetFixedKinematics`, fixed to the
floor at the start of the jump. Where gravity points in it is learned before lift-off from what
IMU and kinematics say while the left sole is loaded and flat; so neither a slope nor a bias of
the encoders moves the soles from where they are level with that floor.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.robot.icub import BASE_YAW, GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]

CONTACT_GAIN = 40.0
"""How fast loaded soles correct velocity and position of the base (1/s)."""
FLAT_GAIN = 5.0
"""How fast the left sole, loaded and flat, corrects the attitude (1/s)."""
TILT_GAIN = 2.0
"""How fast the measured direction of gravity corrects the attitude elsewhere (1/s)."""
BALLISTIC_GAIN = 60.0
"""How fast IMU and joints correct free fall and the conserved momentum in the air (1/s)."""
FLATNESS = math.radians(2.0)
"""Tilt of the sole (rad) beyond which it is hardly taken for flat."""
NO_LOAD, FULL_LOAD = 0.1, 0.3
"""Shares of the weight on the feet up to which, and from which on, they are a reference."""
AVERAGED = 100
"""Over how many readings the direction of gravity is averaged at most."""
LIFT_OFF_READINGS = 2
"""How many readings without load in a row are a lift-off; a single one may be noise."""


class ImuEstimator:
    """Believes the feet as far as they stand, else the IMU."""

    def __init__(self, kinematics: FeetFixedKinematics, dt: float) -> None:
        """Set up the estimator.

        Args:
            kinematics: The model that :meth:`estimate` keeps up to date.
            dt: Time between readings (s).
        """
        self._kinematics, self._dt = kinematics, dt
        robot = kinematics.robot
        n = robot.n_joints
        self._legs = robot.left_leg, robot.right_leg
        self._weight = GRAVITY * kinematics.mass
        self._base_R_imu = pin.exp3(np.array([0.0, 0.0, BASE_YAW]))
        self._state = RobotState(
            joint_position=np.zeros(n),
            joint_velocity=np.zeros(n),
            base_rotation=np.eye(3),
            angular_velocity=np.zeros(3),
            com=np.zeros(3),
            com_velocity=np.zeros(3),
            angular_momentum=np.zeros(3),
            foot_force=np.zeros(2),
            sole_position=np.zeros((2, 3)),
            gravity=np.zeros(3),
        )
        self._base_position, self._base_velocity = np.zeros(3), np.zeros(3)
        self._base_twist = np.zeros(6)
        self._soles = np.zeros((2, 3))
        self._footholds = np.zeros((2, 3))
        self.reset()

    def reset(self) -> None:
        """A jump begins: the robot stands at rest on both feet, which anchor the world frame."""
        self._readings = self._unloaded = 0
        self._airborne = self._has_flown = False
        self._base_velocity[:] = 0.0
        self._state.gravity[:] = 0.0, 0.0, -1.0

    def refresh(self, readings: Readings) -> RobotState:
        """The latest state, with a model that is up to date for it."""
        self._kinematics.update(self._state.joint_position)
        return self._state

    def estimate(self, readings: Readings) -> RobotState:
        """Take in the readings of one control tick; the next call overwrites the state."""
        kinematics, state = self._kinematics, self._state
        kinematics.update(readings.joint_position)
        state.joint_position[:] = readings.joint_position
        state.joint_velocity[:] = readings.joint_velocity
        state.foot_force[:] = readings.foot_force
        angular_velocity = self._base_R_imu.dot(readings.gyro)
        if self._readings:
            self._navigate(angular_velocity, self._base_R_imu.dot(readings.accelerometer))
        else:
            state.base_rotation[:] = kinematics.base_rotation
            self._base_position[:] = kinematics.base_position
            self._place_soles()
            self._footholds[:] = state.sole_position
        self._readings += 1
        self._base_twist[3:] = angular_velocity
        self._correct_attitude(self._base_R_imu.dot(readings.gravity))
        self._place_soles()
        self._stand()
        self._conclude()
        return state

    def _navigate(self, angular_velocity: Array, specific_force: Array) -> None:
        """Inertial navigation over one period; base axes."""
        state, dt = self._state, self._dt
        R, velocity = state.base_rotation, self._base_velocity
        turn = (angular_velocity + self._base_twist[3:]) * (0.5 * dt)
        # The specific force is a mean over the period: it belongs to the middle of it.
        gained = R.dot(pin.exp3(0.5 * turn).dot(specific_force))
        gained += GRAVITY * state.gravity
        gained *= dt
        R[:] = R.dot(pin.exp3(turn))
        self._base_position += dt * (velocity + 0.5 * gained)
        velocity += gained

    def _correct_attitude(self, down: Array) -> None:
        """By the left sole, and by the direction of gravity, ``down`` ((3,) base axes)."""
        kinematics, state = self._kinematics, self._state
        R = state.base_rotation
        # Whoever lands turned about the vertical stands as flat as before.
        sole_turn = R.dot(pin.log3(R.T.dot(kinematics.base_rotation)))
        sole_turn[2] = 0.0
        tilt = math.hypot(sole_turn[0], sole_turn[1]) / FLATNESS
        flat = self._load(float(state.foot_force[0]), 0.5) * math.exp(-tilt * tilt)
        if not self._has_flown:
            share = flat / min(self._readings, AVERAGED)
            state.gravity += share * (kinematics.base_rotation.dot(down) - state.gravity)
            state.gravity /= math.hypot(*state.gravity)
        turn = self._share(FLAT_GAIN * flat) * sole_turn
        turn += self._share(TILT_GAIN * (1.0 - flat)) * pin.skew(R.dot(down)).dot(state.gravity)
        R[:] = pin.exp3(turn).dot(R)

    def _place_soles(self) -> None:
        kinematics, state = self._kinematics, self._state
        for foot, (ankle, sole) in enumerate(
            zip(kinematics.base_M_ankles, kinematics.ankle_p_soles, strict=True)
        ):
            self._soles[foot] = ankle.act(sole)
        np.dot(self._soles, state.base_rotation.T, out=state.sole_position)
        state.sole_position += self._base_position

    def _stand(self) -> None:
        """Correct velocity and position by the soles that carry load."""
        kinematics, state = self._kinematics, self._state
        left, right = state.foot_force.tolist()
        load = self._load(left + right)
        self._unloaded = self._unloaded + 1 if load == 0.0 else 0
        if self._unloaded >= LIFT_OFF_READINGS:
            self._airborne = self._has_flown = True
        if load == 0.0:
            return
        if self._airborne:
            self._touch_down()
        taken = self._share(CONTACT_GAIN * load)
        velocity, omega = np.zeros(3), self._base_twist[3:]
        shares = _shares(left, right)
        for foot, share in enumerate(shares):
            if share == 0.0:
                self._footholds[foot] = state.sole_position[foot]
                continue
            jacobian = (kinematics.J_left, kinematics.J_right)[foot]
            twist = jacobian.dot(state.joint_velocity[self._legs[foot]])
            # Of the base, in its own axes, if this sole stands still.
            velocity -= share * (twist[:3] + pin.skew(omega + twist[3:]).dot(self._soles[foot]))
        wanted = state.base_rotation.dot(velocity)
        self._base_velocity += taken * (wanted - self._base_velocity)
        shift = taken * np.dot(shares, self._footholds - state.sole_position)
        self._base_position += shift
        state.sole_position += shift

    def _touch_down(self) -> None:
        """What touches first is on the floor."""
        state = self._state
        self._airborne = False
        height = state.sole_position[np.argmax(state.foot_force), 2]
        self._base_position[2] -= height
        state.sole_position[:, 2] -= height
        self._footholds[:] = state.sole_position

    def _conclude(self) -> None:
        """CoM and momentum, in the air with what is known of their motion."""
        kinematics, state = self._kinematics, self._state
        R = state.base_rotation
        np.dot(R, self._base_twist[3:], out=state.angular_velocity)
        np.dot(self._base_velocity, R, out=self._base_twist[:3])
        momentum = kinematics.A_base.dot(self._base_twist)
        momentum += kinematics.A_joints.dot(state.joint_velocity)
        velocity, angular_momentum = R.dot(momentum[:3]) / kinematics.mass, R.dot(momentum[3:])
        if self._airborne:
            # Only pushes change these.
            share = self._share(BALLISTIC_GAIN)
            state.com_velocity += (GRAVITY * self._dt) * state.gravity
            velocity = state.com_velocity + share * (velocity - state.com_velocity)
            angular_momentum -= state.angular_momentum
            angular_momentum *= share
            angular_momentum += state.angular_momentum
        state.com_velocity[:], state.angular_momentum[:] = velocity, angular_momentum
        np.dot(R, kinematics.base_p_com, out=state.com)
        state.com += self._base_position

    def _load(self, force: float, share: float = 1.0) -> float:
        """How far a normal force (N) makes ``share`` of the feet a reference, from 0 to 1."""
        load = (force / (share * self._weight) - NO_LOAD) / (FULL_LOAD - NO_LOAD)
        return min(1.0, max(0.0, load))

    def _share(self, gain: float) -> float:
        """What a correction with a gain (1/s) takes off an error within one period."""
        return 1.0 - math.exp(-gain * self._dt)


def _shares(left: float, right: float) -> tuple[float, float]:
    """How far each sole counts, given their normal forces (N): not at all without load."""
    least = NO_LOAD * (max(left, 0.0) + max(right, 0.0))
    left, right = (force if force > least else 0.0 for force in (left, right))
    return left / (left + right), right / (left + right)
