"""Balance after a landing: CoP, lunge and load of the feet from the capture point."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import rotate
from icub_jump_env.records import Array, Block, Number, Record
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot

CAPTURE_GAIN, LATERAL_CAPTURE_GAIN = 10.0, 4.0
"""How fast the CoP brings the capture point back, forward and sideways (1/s)."""
SIDE_MARGIN = 0.006
"""The CoP of a foot stays this far within the sides of its sole (m); to heel and toe it may go."""
FARTHEST_SHIFT = 0.06
"""The loads of the feet shift the CoP of both sideways by this much at most (m)."""
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

Pair = Annotated[Array, (2,)]


class Catching(Record):
    """What :func:`catch` knows of the robot, and what it keeps between ticks.

    Attributes:
        mass: kg.
        dt: Control period (s).
        farthest_cop: (2,) bounds of a foot's CoP from the middle of its sole, forward and left (m).
        half_stance: Half of the distance of the soles' middles (m).
        momentum_per_lunge: See :func:`lunge_momentum` (kg m^2).
        rate: Rate of the lunge (rad/s).
        cop: (2,) where the CoP of each foot shall be, forward and left of the middle of its sole
            (m).
        pull: (2,) horizontal force on the CoM that goes with it, forward and left, per load.
        momentum: Angular momentum of the lunge about the robot's left (kg m^2/s).
        lift: Speed at which the right sole shall rise relative to the left one (m/s).
    """

    mass: Number
    dt: Number
    farthest_cop: Pair
    half_stance: Number
    momentum_per_lunge: Number
    rate: Number
    cop: Pair
    pull: Pair
    momentum: Number
    lift: Number

    @classmethod
    def of(cls, kinematics: FeetFixedKinematics, dt: float) -> Catching:
        """That of a robot which does not lunge.

        Args:
            kinematics: The model.
            dt: Control period (s).
        """
        robot = kinematics.robot
        return cls(
            mass=kinematics.mass,
            dt=dt,
            farthest_cop=np.array([robot.sole.half_length, robot.sole.half_width - SIDE_MARGIN]),
            half_stance=kinematics.sole_positions[0, 1],
            momentum_per_lunge=lunge_momentum(robot),
        )


@compiled
def catch(
    kinematics: Block, state: Block, com: Array, away: Array, chest_up: Array, catching: Block
) -> None:
    """One control tick: bring the capture point of an inverted pendulum to rest above the soles.

    First by the CoP; where that is not enough, by a lunge: a motion of hips, torso and arms that
    leaves the CoM where it is and has pitch momentum alone. Sideways also by the loads of the
    feet, which finds a step under one of them.

    Args:
        kinematics: The model, up to date for the state.
        state: The believed state.
        com: (3,) where the CoM shall be, from the middle of the soles (m): forward and left
            of the robot, up.
        away: (n,) joint displacement that is to be taken back (rad).
        chest_up: (3,) the chest's up axis, base axes.
        catching: Block of the :class:`Catching`; this sets what is from the rate on.
    """
    model, s, c = kinematics[0], state[0], catching[0]
    cos, sin = heading(s.base_rotation)
    x = s.com[0] - (s.sole_position[0, 0] + s.sole_position[1, 0]) / 2
    y = s.com[1] - (s.sole_position[0, 1] + s.sole_position[1, 1]) / 2
    z = s.com[2] - (s.sole_position[0, 2] + s.sole_position[1, 2]) / 2
    height = max(LOWEST_COM, z)
    frequency = math.sqrt(GRAVITY / height)
    lever = 1.0 / (c.mass * height)
    # Where the CoM is above the soles along gravity, from where it shall be.
    x -= z * s.gravity[0] / s.gravity[2]
    y -= z * s.gravity[1] / s.gravity[2]
    ahead, left = cos * x + sin * y, cos * y - sin * x
    vx, vy = s.com_velocity[0], s.com_velocity[1]
    Hx, Hy = s.angular_momentum[0], s.angular_momentum[1]
    falling = cos * Hy - sin * Hx - c.momentum_per_lunge * c.rate
    speed = cos * vx + sin * vy + MOMENTUM_SHARE * lever * falling
    point = ahead - com[0] + speed / frequency

    # A lunge's acceleration shifts the CoP that the CoM feels by this much.
    shift = c.momentum_per_lunge * lever / frequency**2
    needed = point * (1.0 + LUNGE_GAIN / frequency)
    lunge = 0.0
    for j in range(away.shape[0]):
        lunge += model.centroidal_map[4, j] * away[j]
    lunge /= c.momentum_per_lunge
    rate = lunge_rate(
        lunge, c.rate, needed / shift, c.farthest_cop[0] / shift, lean(s, chest_up, cos, sin), c.dt
    )
    wanted = point * (1.0 + CAPTURE_GAIN / frequency) - shift * (rate - c.rate) / c.dt
    c.rate = rate
    c.momentum = c.momentum_per_lunge * rate
    c.cop[0] = within(com[0] + wanted, c.farthest_cop[0])
    c.pull[0] = (ahead - c.cop[0]) / height

    speed = cos * vy - sin * vx - MOMENTUM_SHARE * lever * (cos * Hx + sin * Hy)
    point = left - com[1] + speed / frequency
    wanted = com[1] + point * (1.0 + LATERAL_CAPTURE_GAIN / frequency)
    c.cop[1] = within(wanted, c.farthest_cop[1])
    shift = within(wanted - c.cop[1], FARTHEST_SHIFT)
    c.pull[1] = (left - c.cop[1] - shift) / height
    on_left, on_right = s.foot_force[0], s.foot_force[1]
    more = (on_left + on_right) * shift / c.half_stance
    c.lift = within(LOAD_GAIN * (more - on_left + on_right), FASTEST_LIFT)


@compiled
def lean(state: Block, chest_up: Array, cos: float, sin: float) -> float:
    """Lean of the chest (rad), forward where the robot faces: its yaw by cosine and sine."""
    up = np.empty(3)
    rotate(state.base_rotation, chest_up, up)
    return math.atan2(cos * up[0] + sin * up[1], up[2])


@compiled
def lunge_rate(
    lunge: float, rate: float, needed: float, borne: float, lean: float, dt: float
) -> float:
    """Rate of the lunge (rad/s) from now on.

    Args:
        lunge: How far it went (rad).
        rate: Its rate so far (rad/s).
        needed: Acceleration of the lunge that would do without a CoP (rad/s^2).
        borne: Acceleration that the CoP bears (rad/s^2).
        lean: Lean of the chest (rad).
        dt: Control period (s).
    """
    back = within(-RETURN_STIFFNESS * lunge - RETURN_DAMPING * rate, HARDEST_RETURN)
    wanted = min(max(back, needed - borne), needed + borne)
    rate += dt * within(wanted, HARDEST_LUNGE)
    backward = min(FARTHEST_LUNGE + lunge, (FARTHEST_LEAN + lean) / LEAN_PER_LUNGE)
    forward = min(FARTHEST_LUNGE - lunge, (FARTHEST_LEAN - lean) / LEAN_PER_LUNGE)
    return min(max(rate, -stoppable(backward)), stoppable(forward))


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


@compiled
def stoppable(way: float) -> float:
    """Speed of a lunge (rad/s) that can be stopped within ``way`` (rad)."""
    return min(FASTEST_LUNGE, math.sqrt(2.0 * STOPPING_LUNGE * max(0.0, way)))


@compiled
def within(value: float, bound: float) -> float:
    """The value, but for what is beyond plus or minus the bound."""
    return min(max(value, -bound), bound)
