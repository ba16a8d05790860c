"""Dynamics of standing on two fixed feet, with the contact wrenches as unknowns.

With the left foot at rest the base acceleration follows from the joints, which leaves

    base rows:   B_s s_ddot - X f = b                 (6)
    joint rows:  tau = T_s s_ddot - L f + t           (n)

of the equations of motion (eq. 1), where f = (f_left, f_right) are the contact wrenches
(force, moment) in the sole frames. All other quantities are in the axes of the base.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pinocchio as pin

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import rotate
from icub_jump_env.records import Array, Block, Number, PerJoint, Record, Vector
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics


class FeetFixedDynamics(Record):
    """Equations of motion on fixed feet; extends :class:`FeetFixedKinematics`.

    Call :meth:`update` after that of the kinematics. Attributes are buffers that the
    next update overwrites.

    Attributes:
        base_rows: (6, n + 12) of (s_ddot, f).
        base_bias: (6,) b; the base rows of eq. 1 are ``base_rows @ x = base_bias``.
        torque_rows: (n, n + 12) of (s_ddot, f).
        torque_bias: (n,) t; joint torques are ``torque_rows @ x + torque_bias`` (Nm).
        foot_bias: (6,) acceleration that the feet would gain relative to each other at
            s_ddot = 0; both stay at rest (eq. 6c) where ``J_feet s_ddot = foot_bias``.
        force_rows: (3, 12) total contact force of f, base axes.
        moment_rows: (3, 12) total moment of f about the CoM, base axes.
        gravity: (3,) in the axes of the base (m/s^2).
        damping: (n,) viscous friction of the joints (Nm s/rad).
        total_mass: kg.
        ankle_X_soles: (2, 6, 6) wrenches in the frames of the soles as ones in those of the ankles.
    """

    base_rows: Annotated[Array, (6, "n + 12")]
    base_bias: Annotated[Array, (6,)]
    torque_rows: Annotated[Array, ("n", "n + 12")]
    torque_bias: PerJoint
    foot_bias: Annotated[Array, (6,)]
    force_rows: Annotated[Array, (3, 12)]
    moment_rows: Annotated[Array, (3, 12)]
    gravity: Vector
    damping: PerJoint
    total_mass: Number
    ankle_X_soles: Annotated[Array, (2, 6, 6)]

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        self._kinematics = kinematics
        robot, model = kinematics.robot, kinematics.model.copy()
        n, data = robot.n_joints, model.createData()
        frames = [model.frames[model.getFrameId(name)] for name in robot.sole_frames]
        super().__init__(
            {"n": n, "n + 12": n + 12},
            damping=model.damping[6:],
            total_mass=kinematics.mass,
            ankle_X_soles=[frame.placement.toDualActionMatrix() for frame in frames],
        )
        self._model, self._data = model, data
        self._q, self._v = pin.neutral(model), np.zeros(model.nv)
        left, right = kinematics.base_M_ankles
        # Views of Pinocchio's buffers: reading an attribute costs more than using it.
        self._drifts = [data.a_gf[frame.parentJoint] for frame in frames]
        self._buffers = (
            data.M, data.nle, kinematics.data.J,
            left.rotation, left.translation, right.rotation, right.translation, kinematics.base_p_com,
        )  # fmt: skip

    def __reduce__(self) -> tuple[type[FeetFixedDynamics], tuple[FeetFixedKinematics]]:
        # The buffers are filled anew by the next update.
        return FeetFixedDynamics, (self._kinematics,)

    def update(self, joint_position: Array, joint_velocity: Array) -> None:
        """Recompute all attributes.

        Args:
            joint_position: (n,) rad; the kinematics must be updated for it already.
            joint_velocity: (n,) rad/s.
        """
        model, data, q, v = self._model, self._data, self._q, self._v
        kinematics = self._kinematics
        q[7:] = joint_position
        move_with_base(kinematics.block, kinematics.data.J, joint_velocity, v, self.block)
        model.gravity.linear = self.gravity
        pin.nonLinearEffects(model, data, q, v)
        pin.crba(model, data, q)
        left, right = self._drifts
        stand_on_both_feet(*self._buffers, left.vector, right.vector, v, self.block)


@compiled
def move_with_base(
    kinematics: Block, J: Array, joint_velocity: Array, velocity: Array, dynamics: Block
) -> None:
    """Velocity, and gravity in the axes of the base, of a robot whose left foot stands still.

    Args:
        kinematics: The model, up to date.
        J: (6, n + 6) Jacobians of all joints, base axes.
        joint_velocity: (n,) rad/s.
        velocity: (n + 6,) Pinocchio's velocity, which this fills.
        dynamics: Block of the :class:`FeetFixedDynamics`, of which this sets the gravity.
    """
    for i in range(6):
        velocity[i] = 0.0
        for j in range(6):
            velocity[i] -= J[i, 6 + j] * joint_velocity[j]
    velocity[6:] = joint_velocity
    # An inertial frame that coincides with the base at this instant.
    for i in range(3):
        dynamics[0].gravity[i] = -GRAVITY * kinematics[0].base_rotation[2, i]


@compiled
def stand_on_both_feet(
    M: Array,
    nle: Array,
    J: Array,
    left_R: Array,
    left_p: Array,
    right_R: Array,
    right_p: Array,
    base_p_com: Array,
    left_drift: Array,
    right_drift: Array,
    velocity: Array,
    dynamics: Block,
) -> None:
    """From the equations of motion of a free base to those of feet at rest.

    Args:
        M: (n + 6, n + 6) mass matrix.
        nle: (n + 6,) what joint torques balance at rest of the accelerations.
        J: (6, n + 6) Jacobians of all joints, base axes.
        left_R: (3, 3) orientation of the left ankle, base axes.
        left_p: (3,) its position (m).
        right_R: Of the right ankle.
        right_p: Likewise.
        base_p_com: (3,) position of the CoM (m).
        left_drift: (6,) acceleration of the left ankle at nu_dot = 0, minus gravity, in its own
            axes.
        right_drift: Of the right ankle.
        velocity: (n + 6,) base twist and joint velocities.
        dynamics: Block of the :class:`FeetFixedDynamics`, which this fills.
    """
    d = dynamics[0]
    n = d.torque_bias.shape[0]
    drift, right = np.empty(6), np.empty(6)
    base_acceleration(left_R, left_p, left_drift, d.gravity, drift)
    base_acceleration(right_R, right_p, right_drift, d.gravity, right)
    for i in range(6):
        d.foot_bias[i] = right[i] - drift[i]

    wrench = np.empty((6, 6))
    for foot in range(2):
        if foot == 0:
            wrench_in_base(left_R, left_p, d.ankle_X_soles[0], wrench)
        else:
            wrench_in_base(right_R, right_p, d.ankle_X_soles[1], wrench)
        first, leg = n + 6 * foot, 6 * foot
        for column in range(6):
            for i in range(6):
                d.base_rows[i, first + column] = -wrench[i, column]
                value = 0.0
                for k in range(6):
                    value -= J[k, 6 + leg + i] * wrench[k, column]
                d.torque_rows[leg + i, first + column] = value
            for i in range(3):
                d.force_rows[i, 6 * foot + column] = wrench[i, column]
            x, y, z = wrench[0, column], wrench[1, column], wrench[2, column]
            cx, cy, cz = base_p_com[0], base_p_com[1], base_p_com[2]
            d.moment_rows[0, 6 * foot + column] = wrench[3, column] - (cy * z - cz * y)
            d.moment_rows[1, 6 * foot + column] = wrench[4, column] - (cz * x - cx * z)
            d.moment_rows[2, 6 * foot + column] = wrench[5, column] - (cx * y - cy * x)

    for i in range(6):
        d.base_bias[i] = -nle[i]
        for j in range(n):
            d.base_rows[i, j] = M[i, 6 + j]
        for k in range(6):
            d.base_bias[i] += M[i, k] * drift[k]
            for j in range(6):
                d.base_rows[i, j] -= M[i, k] * J[k, 6 + j]
    for i in range(n):
        d.torque_bias[i] = nle[6 + i] + d.damping[i] * velocity[6 + i]
        for j in range(n):
            d.torque_rows[i, j] = M[6 + i, 6 + j]
        for k in range(6):
            d.torque_bias[i] -= M[6 + i, k] * drift[k]
            for j in range(6):
                d.torque_rows[i, j] -= M[6 + i, k] * J[k, 6 + j]


@compiled
def base_acceleration(R: Array, p: Array, drift: Array, gravity: Array, out: Array) -> None:
    """Acceleration of a joint, given in its own axes without gravity, as one of the base.

    Args:
        R: (3, 3) orientation of the joint, base axes.
        p: (3,) its position (m).
        drift: (6,) its spatial acceleration in its own axes.
        gravity: (3,) base axes.
        out: (6,) the same as acceleration of the base, base axes, with gravity.
    """
    rotate(R, drift[3:], out[3:])
    rotate(R, drift[:3], out[:3])
    x, y, z = out[3], out[4], out[5]
    out[0] += p[1] * z - p[2] * y + gravity[0]
    out[1] += p[2] * x - p[0] * z + gravity[1]
    out[2] += p[0] * y - p[1] * x + gravity[2]


@compiled
def wrench_in_base(R: Array, p: Array, ankle_X_sole: Array, out: Array) -> None:
    """(6, 6) map of a wrench in a sole's frame to one in the base's.

    Args:
        R: (3, 3) orientation of the ankle, base axes.
        p: (3,) its position (m).
        ankle_X_sole: (6, 6) map of a wrench in the sole's frame to one in the ankle's.
        out: (6, 6) the map, which this fills.
    """
    for column in range(6):
        rotate(R, ankle_X_sole[:3, column], out[:3, column])
        rotate(R, ankle_X_sole[3:, column], out[3:, column])
        x, y, z = out[0, column], out[1, column], out[2, column]
        out[3, column] += p[1] * z - p[2] * y
        out[4, column] += p[2] * x - p[0] * z
        out[5, column] += p[0] * y - p[1] * x
