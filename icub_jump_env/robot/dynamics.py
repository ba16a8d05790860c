"""Dynamics of standing on two fixed feet, with the contact wrenches as unknowns.

With the left foot at rest the base acceleration follows from the joints, which leaves

    base rows:   B_s s_ddot - X f = b                 (6)
    joint rows:  tau = T_s s_ddot - L f + t           (23)

of the equations of motion (eq. 1), where f = (f_left, f_right) are the contact wrenches
(force, moment) in the sole frames. All other quantities are in the axes of the base.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot import facts
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]

GRAVITY = np.array([0.0, 0.0, -9.81])
"""World gravity (m/s^2)."""

_LEGS = slice(0, 12)


class FeetFixedDynamics:
    """Equations of motion on fixed feet; extends :class:`FeetFixedKinematics`.

    Call :meth:`update` after that of the kinematics. Attributes are buffers that the
    next update overwrites.

    Attributes:
        base_rows: (6, 35) of (s_ddot, f).
        base_bias: (6,) b; the base rows of eq. 1 are ``base_rows @ x = base_bias``.
        torque_rows: (23, 35) of (s_ddot, f).
        torque_bias: (23,) t; joint torques are ``torque_rows @ x + torque_bias`` (Nm).
        foot_bias: (6,) acceleration that the feet would gain relative to each other at
            s_ddot = 0; both stay at rest (eq. 6c) where ``J_feet s_ddot = foot_bias``.
        force_rows: (3, 12) total contact force of f, base axes.
        moment_rows: (3, 12) total moment of f about the CoM, base axes.
    """

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        self._kinematics = kinematics
        self._model = kinematics.model.copy()
        self._data: Any = self._model.createData()
        n = facts.N_JOINTS
        self.base_rows = np.zeros((6, n + 12))
        self.base_bias = np.zeros(6)
        self.torque_rows = np.zeros((n, n + 12))
        self.torque_bias = np.zeros(n)
        self.foot_bias = np.zeros(6)
        self.force_rows = np.zeros((3, 12))
        self.moment_rows = np.zeros((3, 12))
        self._damping = np.array(self._model.damping[6:])
        self._q = pin.neutral(self._model)
        self._v = np.zeros(self._model.nv)
        self._soles = [
            self._model.frames[self._model.getFrameId(name)] for name in facts.SOLE_FRAMES
        ]

    def __reduce__(self) -> tuple[type[FeetFixedDynamics], tuple[FeetFixedKinematics]]:
        # The buffers are filled anew by the next update.
        return FeetFixedDynamics, (self._kinematics,)

    def update(self, joint_position: Array, joint_velocity: Array) -> None:
        """Recompute all attributes.

        Args:
            joint_position: (23,) rad; the kinematics must be updated for it already.
            joint_velocity: (23,) rad/s.
        """
        model, data, kinematics = self._model, self._data, self._kinematics
        J_left, J_right = kinematics.J_left, kinematics.J_right
        # An inertial frame that coincides with the base at this instant.
        gravity = kinematics.base_rotation.T.dot(GRAVITY)
        model.gravity.linear = gravity
        self._q[7:] = joint_position
        self._v[:6] = -J_left.dot(joint_velocity[facts.LEFT_LEG])
        self._v[6:] = joint_velocity
        h = pin.nonLinearEffects(model, data, self._q, self._v)
        M = pin.crba(model, data, self._q)

        drifts, n = [], facts.N_JOINTS
        for foot, frame in enumerate(self._soles):
            placement = kinematics.data.oMi[frame.parentJoint]
            drift = placement.act(data.a_gf[frame.parentJoint]).vector
            drift[:3] += gravity
            drifts.append(drift)
            wrench = placement.act(frame.placement).toDualActionMatrix()
            columns = slice(n + 6 * foot, n + 6 * foot + 6)
            self.base_rows[:, columns] = -wrench
            leg, J = ((facts.LEFT_LEG, J_left), (facts.RIGHT_LEG, J_right))[foot]
            self.torque_rows[leg, columns] = -J.T.dot(wrench)
        np.subtract(drifts[1], drifts[0], out=self.foot_bias)

        M_base, M_coupling = M[:6, :6], M[:6, 6:]
        self.base_rows[:, :n] = M_coupling
        self.base_rows[:, facts.LEFT_LEG] -= M_base.dot(J_left)
        np.subtract(M_base.dot(drifts[0]), h[:6], out=self.base_bias)
        # crba fills the upper triangle only.
        joint_rows = self.torque_rows[:, :n]
        upper = M[6:, 6:]
        np.add(np.triu(upper), np.triu(upper, 1).T, out=joint_rows)
        joint_rows[:, facts.LEFT_LEG] -= M_coupling.T.dot(J_left)
        np.subtract(h[6:], M_coupling.T.dot(drifts[0]), out=self.torque_bias)
        self.torque_bias += self._damping * joint_velocity

        np.negative(self.base_rows[:3, n:], out=self.force_rows)
        np.negative(self.base_rows[3:, n:], out=self.moment_rows)
        self.moment_rows -= pin.skew(kinematics.base_p_com).dot(self.force_rows)
