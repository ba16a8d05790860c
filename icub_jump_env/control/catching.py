"""Balance after a landing: CoP, lunge and load of the feet from the capture point."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]

CAPTURE_GAIN, LATERAL_CAPTURE_GAIN = 10.0, 4.0
"""How fast the CoP brings the capture point back, forward and sideways (1/s)."""
FARTHEST_COP, FARTHEST_LATERAL_COP = 0.075, 0.06
"""Bounds of the CoP from the middle of the soles, forward and sideways (m)."""
LOWEST_COM = 0.2
"""Height that the pendulum has at least (m): a robot that falls is none."""
MOMENTUM_SHARE = 0.5
"""How much of the angular momentum that is no lunge counts as speed of the CoM."""
LUNGE_GAIN = 4.0
"""The lunge helps where the CoP cannot bring the capture point back this fast (1/s)."""
HARDEST_LUNGE, FASTEST_LUNGE, STOPPING_LUNGE = 50.0, 4.0, 30.0
"""Largest acceleration, speed, and the deceleration counted on (rad/s^2, rad/s)."""
FARTHEST_LUNGE = 0.7
"""Range of the lunge, backward and forward (rad)."""
FARTHEST_LEAN, LEAN_PER_LUNGE = math.radians(50.0), 1.7
"""Lean of the chest that ends it (rad), and how much a lunge leans it."""
RETURN_STIFFNESS, RETURN_DAMPING, HARDEST_RETURN = 10.0, 6.0, 4.0
"""How a lunge is taken back (1/s^2, 1/s), as far as the CoP bears it (rad/s^2)."""
LOAD_GAIN, FASTEST_LIFT = 0.0002, 0.4
"""Speed of the feet relative to each other per wrong load (m/s per N), and the largest (m/s)."""


class Balance(NamedTuple):
    """What keeps the balance.

    Attributes:
        cop: Where the CoP shall be, forward of the ankles (m).
        pitch_momentum: Angular momentum of the lunge about the robot's left (kg m^2/s).
        lift: Speed at which the right sole shall rise relative to the left one (m/s).
    """

    cop: float
    pitch_momentum: float
    lift: float


class Catch:
    """Brings the capture point of an inverted pendulum to rest above the soles.

    First by the CoP; where that is not enough, by a lunge: a motion of hips, torso and arms that
    leaves the CoM where it is and has pitch momentum alone. Sideways by the loads of the feet,
    which also finds a step under one of them.
    """

    def __init__(self, kinematics: FeetFixedKinematics, dt: float) -> None:
        """Set up the layer.

        Args:
            kinematics: The model, which the estimator keeps up to date.
            dt: Control period (s).
        """
        self._kinematics, self._dt = kinematics, dt
        robot = kinematics.robot
        self._soles_from_ankles = robot.sole.center_x
        self._half_stance = float(kinematics.sole_positions[0, 1])
        self._momentum_per_lunge = lunge_momentum(robot)
        self._rate = 0.0

    def start(self) -> None:
        """A touch-down: the robot does not lunge."""
        self._rate = 0.0

    def update(self, state: RobotState, com: Array, away: Array) -> Balance:
        """One control tick.

        Args:
            state: The believed state.
            com: (3,) where the CoM shall be, from the middle of the soles (m): forward and left
                of the robot, up.
            away: (n,) joint displacement that is to be taken back (rad).
        """
        mass, dt = self._kinematics.mass, self._dt
        # A dozen numbers: floats take a third of the time of arrays.
        cos, sin = heading(state.base_rotation)
        x, y, z = state.com.tolist()
        left_sole, right_sole = state.sole_position.tolist()
        goal_ahead, goal_left, _ = com.tolist()
        vx, vy, _ = state.com_velocity.tolist()
        Hx, Hy, _ = state.angular_momentum.tolist()
        gx, gy, gz = state.gravity.tolist()
        x -= (left_sole[0] + right_sole[0]) / 2
        y -= (left_sole[1] + right_sole[1]) / 2
        z -= (left_sole[2] + right_sole[2]) / 2
        height = max(LOWEST_COM, z)
        frequency = math.sqrt(GRAVITY / height)
        lever = 1.0 / (mass * height)
        # Where the CoM is above the soles along gravity, from where it shall be.
        x, y = x - z * gx / gz, y - z * gy / gz
        ahead, left = cos * x + sin * y, cos * y - sin * x
        falling = cos * Hy - sin * Hx - self._momentum_per_lunge * self._rate
        speed = cos * vx + sin * vy + MOMENTUM_SHARE * lever * falling
        point = ahead - goal_ahead + speed / frequency

        # A lunge's acceleration shifts the CoP that the CoM feels by this much.
        shift = self._momentum_per_lunge * lever / frequency**2
        needed = point * (1.0 + LUNGE_GAIN / frequency)
        lunge = float(self._kinematics.J_momentum[1].dot(away)) / self._momentum_per_lunge
        lean = self._lean(state, cos, sin)
        rate = self._lunge_rate(lunge, needed / shift, FARTHEST_COP / shift, lean)
        wanted = point * (1.0 + CAPTURE_GAIN / frequency) - shift * (rate - self._rate) / dt
        self._rate = rate
        cop = _within(goal_ahead + wanted, FARTHEST_COP)

        speed = cos * vy - sin * vx - MOMENTUM_SHARE * lever * (cos * Hx + sin * Hy)
        point = left - goal_left + speed / frequency
        wanted = goal_left + point * (1.0 + LATERAL_CAPTURE_GAIN / frequency)
        on_left, on_right = state.foot_force.tolist()
        more = (on_left + on_right) * _within(wanted, FARTHEST_LATERAL_COP) / self._half_stance
        lift = _within(LOAD_GAIN * (more - on_left + on_right), FASTEST_LIFT)
        return Balance(cop + self._soles_from_ankles, self._momentum_per_lunge * rate, lift)

    def _lean(self, state: RobotState, cos: float, sin: float) -> float:
        """Lean of the chest, forward (rad)."""
        x, y, z = state.base_rotation.dot(self._kinematics.chest_up()).tolist()
        return math.atan2(cos * x + sin * y, z)

    def _lunge_rate(self, lunge: float, needed: float, borne: float, lean: float) -> float:
        """Rate of the lunge (rad/s) from now on.

        Args:
            lunge: How far it went (rad).
            needed: Acceleration of the lunge that would do without a CoP (rad/s^2).
            borne: Acceleration that the CoP bears (rad/s^2).
            lean: Lean of the chest (rad).
        """
        back = -RETURN_STIFFNESS * lunge - RETURN_DAMPING * self._rate
        wanted = min(max(_within(back, HARDEST_RETURN), needed - borne), needed + borne)
        rate = self._rate + self._dt * _within(wanted, HARDEST_LUNGE)
        backward = min(FARTHEST_LUNGE + lunge, (FARTHEST_LEAN + lean) / LEAN_PER_LUNGE)
        forward = min(FARTHEST_LUNGE - lunge, (FARTHEST_LEAN - lean) / LEAN_PER_LUNGE)
        return min(max(rate, -_stoppable(backward)), _stoppable(forward))


def lunge_momentum(robot: Robot) -> float:
    """Pitch momentum (kg m^2) per rate of a lunge, which counts its fastest joint (rad).

    It is the smallest motion of the joints from the landing posture that leaves feet and CoM
    where they are and has no other momentum.
    """
    kinematics = FeetFixedKinematics(robot)
    kinematics.update(robot.landing)
    ease = robot.per_joint("lunge", (1.0, 1.0, 0.5))
    constraints = np.vstack((kinematics.J_feet, kinematics.centroidal_map))
    per_momentum = ease * np.linalg.pinv(constraints * ease, rcond=1e-6)[:, -2]
    return 1.0 / float(np.abs(per_momentum[: robot.arms.start]).max())


def _stoppable(way: float) -> float:
    """Speed of a lunge (rad/s) that can be stopped within ``way`` (rad)."""
    return min(FASTEST_LUNGE, math.sqrt(2.0 * STOPPING_LUNGE * max(0.0, way)))


def _within(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
