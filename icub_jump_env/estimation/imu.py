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
from typing import Annotated

import numpy as np
import pinocchio as pin

from icub_jump_env.compiled import compiled
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.linear_algebra import (
    add_cross,
    multiply,
    rotate,
    rotate_back,
    rotation_of,
    turn_of,
)
from icub_jump_env.records import Array, Block, Number, Record, Rotation, Vector
from icub_jump_env.robot.icub import BASE_YAW, GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics

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


class Memory(Record):
    """What the estimator keeps between readings, world frame unless said.

    Attributes:
        dt: Time between readings (s).
        weight: Of the robot (N).
        base_R_imu: (3, 3) from the IMU's axes to those of the base.
        readings: How many there were.
        unloaded: How many in a row were without load.
        airborne, has_flown: Whether the robot is in the air, and ever was: 0 or 1.
        base_position, base_velocity: (3,) m, m/s.
        base_twist: (6,) linear (m/s) and angular (rad/s), base axes.
        soles: (2, 3) middles of the soles from the base, base axes (m).
        footholds: (2, 3) where loaded soles stand (m).
    """

    dt: Number
    weight: Number
    base_R_imu: Rotation
    readings: Number
    unloaded: Number
    airborne: Number
    has_flown: Number
    base_position: Vector
    base_velocity: Vector
    base_twist: Annotated[Array, (6,)]
    soles: Annotated[Array, (2, 3)]
    footholds: Annotated[Array, (2, 3)]


class ImuEstimator:
    """Believes the feet as far as they stand, else the IMU."""

    def __init__(self, kinematics: FeetFixedKinematics, dt: float) -> None:
        """Set up the estimator.

        Args:
            kinematics: The model that :meth:`estimate` keeps up to date.
            dt: Time between readings (s).
        """
        self._kinematics = kinematics
        self._memory = Memory(
            dt=dt,
            weight=GRAVITY * kinematics.mass,
            base_R_imu=pin.exp3(np.array([0.0, 0.0, BASE_YAW])),
        )
        self._state = RobotState({"n": kinematics.robot.n_joints}, base_rotation=np.eye(3))
        self._bind()
        self.reset()

    def _bind(self) -> None:
        left, right = self._kinematics.base_M_ankles
        self._ankles = (
            left.rotation, left.translation, right.rotation, right.translation,
            *self._kinematics.ankle_p_soles,
        )  # fmt: skip

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name != "_ankles"}

    def __setstate__(self, state: dict[str, object]) -> None:
        # Views of Pinocchio's buffers, which a copy takes of its own model.
        vars(self).update(state)
        self._bind()

    def reset(self) -> None:
        """A jump begins: the robot stands at rest on both feet, which anchor the world frame."""
        memory = self._memory
        memory.readings = memory.unloaded = memory.airborne = memory.has_flown = 0.0
        memory.base_velocity[:] = 0.0
        self._state.gravity[:] = 0.0, 0.0, -1.0

    def refresh(self, readings: Readings) -> RobotState:
        """The latest state, with a model that is up to date for it."""
        self._kinematics.update(self._state.joint_position)
        return self._state

    def estimate(self, readings: Readings) -> RobotState:
        """Take in the readings of one control tick; the next call overwrites the state."""
        kinematics, state = self._kinematics, self._state
        kinematics.update(readings.joint_position)
        blocks = kinematics.block, readings.block, state.block, self._memory.block
        find_soles(self._memory.block, *self._ankles)
        self._predict(*blocks)
        self._correct_attitude(*blocks)
        self._stand(*blocks)
        conclude(kinematics.data.Ag, kinematics.base_p_com, *blocks)
        return state

    def _predict(self, *blocks: Block) -> None:
        predict(*blocks)

    def _correct_attitude(self, *blocks: Block) -> None:
        correct_attitude(*blocks)

    def _stand(self, *blocks: Block) -> None:
        stand(self._kinematics.data.J, *blocks)


@compiled
def find_soles(
    memory: Block,
    left_R: Array,
    left_p: Array,
    right_R: Array,
    right_p: Array,
    left_sole: Array,
    right_sole: Array,
) -> None:
    """Where the soles are from the base.

    Args:
        memory: Block of the :class:`Memory`, of which this sets the soles.
        left_R: (3, 3) orientation of the left ankle, base axes.
        left_p: (3,) its position (m).
        right_R: Of the right ankle.
        right_p: Likewise.
        left_sole: (3,) middle of the left sole's underside in the frame of its ankle (m).
        right_sole: Of the right sole.
    """
    soles = memory[0].soles
    rotate(left_R, left_sole, soles[0])
    rotate(right_R, right_sole, soles[1])
    for i in range(3):
        soles[0, i] += left_p[i]
        soles[1, i] += right_p[i]


@compiled
def place_soles(state: Block, memory: Block) -> None:
    """Where they are in the world."""
    for foot in range(2):
        rotate(state.base_rotation, memory.soles[foot], state.sole_position[foot])
        for i in range(3):
            state.sole_position[foot, i] += memory.base_position[i]


@compiled
def predict(kinematics: Block, readings: Block, state: Block, memory: Block) -> None:
    """Take in the readings: inertial navigation over one period.

    Args:
        kinematics: The model, up to date.
        readings: What the sensors said.
        state: What is believed.
        memory: Block of the :class:`Memory`.
    """
    k, told, s, m = kinematics[0], readings[0], state[0], memory[0]
    s.joint_position[:] = told.joint_position
    s.joint_velocity[:] = told.joint_velocity
    s.foot_force[:] = told.foot_force
    angular_velocity, specific_force = np.empty(3), np.empty(3)
    rotate(m.base_R_imu, told.gyro, angular_velocity)
    rotate(m.base_R_imu, told.accelerometer, specific_force)
    if m.readings > 0.0:
        turn, half = np.empty(3), np.empty(3)
        for i in range(3):
            turn[i] = (angular_velocity[i] + m.base_twist[3 + i]) * (0.5 * m.dt)
            half[i] = 0.5 * turn[i]
        # The specific force is a mean over the period: it belongs to the middle of it.
        step, force, gained = np.empty((3, 3)), np.empty(3), np.empty(3)
        rotation_of(half, step)
        rotate(step, specific_force, force)
        rotate(s.base_rotation, force, gained)
        turn_by(s.base_rotation, turn)
        for i in range(3):
            gained[i] = m.dt * (gained[i] + GRAVITY * s.gravity[i])
            m.base_position[i] += m.dt * (m.base_velocity[i] + 0.5 * gained[i])
            m.base_velocity[i] += gained[i]
    else:
        s.base_rotation[:] = k.base_rotation
        m.base_position[:] = k.base_position
        place_soles(s, m)
        m.footholds[:] = s.sole_position
    m.readings += 1.0
    m.base_twist[3:] = angular_velocity


@compiled
def turn_by(R: Array, turn: Array) -> None:
    """Turn an attitude by a rotation vector (rad) in its own axes."""
    step, before = np.empty((3, 3)), R.copy()
    rotation_of(turn, step)
    multiply(before, step, R)


@compiled
def correct_attitude(kinematics: Block, readings: Block, state: Block, memory: Block) -> None:
    """By the left sole, and by the direction of gravity; arguments as of :func:`predict`."""
    k, told, s, m = kinematics[0], readings[0], state[0], memory[0]
    R = s.base_rotation
    down, world_down, towards, sole_turn = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    rotate(m.base_R_imu, told.gravity, down)
    # Whoever lands turned about the vertical stands as flat as before.
    between = np.empty((3, 3))
    multiply(R.T, k.base_rotation, between)
    turn_of(between, towards)
    rotate(R, towards, sole_turn)
    sole_turn[2] = 0.0
    tilt = math.hypot(sole_turn[0], sole_turn[1]) / FLATNESS
    flat = load_of(m, s.foot_force[0], 0.5) * math.exp(-tilt * tilt)
    if m.has_flown == 0.0:
        share = flat / min(m.readings, AVERAGED)
        rotate(k.base_rotation, down, world_down)
        for i in range(3):
            s.gravity[i] += share * (world_down[i] - s.gravity[i])
        length = math.sqrt(s.gravity[0] ** 2 + s.gravity[1] ** 2 + s.gravity[2] ** 2)
        for i in range(3):
            s.gravity[i] /= length
    by_sole, by_gravity = share_of(m, FLAT_GAIN * flat), share_of(m, TILT_GAIN * (1.0 - flat))
    rotate(R, down, world_down)
    for i in range(3):
        sole_turn[i] *= by_sole
    add_cross(world_down, s.gravity, by_gravity, sole_turn)
    # About axes of the world.
    rotate_back(R, sole_turn, towards)
    turn_by(R, towards)


@compiled
def stand(J: Array, kinematics: Block, readings: Block, state: Block, memory: Block) -> None:
    """Correct velocity and position by the soles that carry load.

    Args:
        J: (6, n + 6) Jacobians of all joints, base axes.
        kinematics: The model, up to date.
        readings: What the sensors said.
        state: What is believed.
        memory: Block of the :class:`Memory`.
    """
    s, m = state[0], memory[0]
    place_soles(s, m)
    left, right = s.foot_force[0], s.foot_force[1]
    load = load_of(m, left + right, 1.0)
    m.unloaded = m.unloaded + 1.0 if load == 0.0 else 0.0
    if m.unloaded >= LIFT_OFF_READINGS:
        m.airborne = m.has_flown = 1.0
    if load == 0.0:
        return
    if m.airborne:
        touch_down(s, m)
    taken = share_of(m, CONTACT_GAIN * load)
    least = NO_LOAD * (max(left, 0.0) + max(right, 0.0))
    carried = (left if left > least else 0.0) + (right if right > least else 0.0)
    velocity, world_velocity, shift = np.zeros(3), np.empty(3), np.zeros(3)
    linear, turning = np.empty(3), np.empty(3)
    for foot in range(2):
        force = s.foot_force[foot]
        if force <= least:
            m.footholds[foot] = s.sole_position[foot]
            continue
        share = force / carried
        for i in range(3):
            linear[i], turning[i] = 0.0, m.base_twist[3 + i]
            for j in range(6):
                rate = s.joint_velocity[6 * foot + j]
                linear[i] += J[i, 6 + 6 * foot + j] * rate
                turning[i] += J[3 + i, 6 + 6 * foot + j] * rate
        # Of the base, in its own axes, if this sole stands still.
        add_cross(turning, m.soles[foot], -share, velocity)
        for i in range(3):
            velocity[i] -= share * linear[i]
            shift[i] += share * (m.footholds[foot, i] - s.sole_position[foot, i])
    rotate(s.base_rotation, velocity, world_velocity)
    for i in range(3):
        m.base_velocity[i] += taken * (world_velocity[i] - m.base_velocity[i])
        m.base_position[i] += taken * shift[i]
        for foot in range(2):
            s.sole_position[foot, i] += taken * shift[i]


@compiled
def touch_down(state: Block, memory: Block) -> None:
    """What touches first is on the floor."""
    memory.airborne = 0.0
    first = 1 if state.foot_force[1] > state.foot_force[0] else 0
    height = state.sole_position[first, 2]
    memory.base_position[2] -= height
    for foot in range(2):
        state.sole_position[foot, 2] -= height
    memory.footholds[:] = state.sole_position


@compiled
def conclude(
    A: Array,
    base_p_com: Array,
    kinematics: Block,
    readings: Block,
    state: Block,
    memory: Block,
) -> None:
    """CoM and momentum, in the air with what is known of their motion.

    Args:
        A: (6, n + 6) centroidal momentum of base twist and joint velocities, base axes.
        base_p_com: (3,) position of the CoM in the base (m).
        kinematics: The model, up to date.
        readings: What the sensors said.
        state: What is believed.
        memory: Block of the :class:`Memory`.
    """
    k, s, m = kinematics[0], state[0], memory[0]
    rotate(s.base_rotation, m.base_twist[3:], s.angular_velocity)
    rotate_back(s.base_rotation, m.base_velocity, m.base_twist[:3])
    momentum = np.zeros(6)
    for i in range(6):
        for j in range(6):
            momentum[i] += A[i, j] * m.base_twist[j]
        for j in range(s.joint_velocity.shape[0]):
            momentum[i] += A[i, 6 + j] * s.joint_velocity[j]
    velocity, angular_momentum = np.empty(3), np.empty(3)
    rotate(s.base_rotation, momentum[:3], velocity)
    rotate(s.base_rotation, momentum[3:], angular_momentum)
    rotate(s.base_rotation, base_p_com, s.com)
    share = share_of(m, BALLISTIC_GAIN)
    for i in range(3):
        s.com[i] += m.base_position[i]
        velocity[i] /= k.total_mass
        if m.airborne:
            # Only pushes change these.
            falling = s.com_velocity[i] + GRAVITY * m.dt * s.gravity[i]
            s.com_velocity[i] = falling + share * (velocity[i] - falling)
            s.angular_momentum[i] += share * (angular_momentum[i] - s.angular_momentum[i])
        else:
            s.com_velocity[i], s.angular_momentum[i] = velocity[i], angular_momentum[i]


@compiled
def load_of(memory: Block, force: float, share: float) -> float:
    """How far a normal force (N) makes ``share`` of the feet a reference, from 0 to 1."""
    load: float = (force / (share * memory.weight) - NO_LOAD) / (FULL_LOAD - NO_LOAD)
    return min(1.0, max(0.0, load))


@compiled
def share_of(memory: Block, gain: float) -> float:
    """What a correction with a gain (1/s) takes off an error within one period."""
    return 1.0 - math.exp(-gain * memory.dt)
