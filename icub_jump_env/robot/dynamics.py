"""Dynamics of standing on two fixed feet, with the contact wrenches as unknowns.

With the left foot at rest the base acceleration follows from the joints, which leaves

    base rows:   B_s s_ddot - X f = b                 (6)
    joint rows:  tau = T_s s_ddot - L f + t           (n)

of the equations of motion (eq. 1), where f = (f_left, f_right) are the contact wrenches
(force, moment) in the sole frames. All other quantities are in the axes of the base.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot.icub import GRAVITY as STANDARD_GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]

GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY])
"""Acceleration of gravity, world (m/s^2)."""


@dataclass
class _Foot:
    """Views of what belongs to one foot.

    Attributes:
        placement: Last leg joint in the base frame, as the kinematics left it.
        drift: Its acceleration at nu_dot = 0, minus gravity.
        sole: (6, 6) moves a wrench from the sole frame to that joint.
        J: (6, 6) twist of the foot of its leg's joints.
        base_rows, torque_rows: Where the foot's wrench enters the rows.
        wrench: (6, 6) moves a wrench from the sole frame to the base.
    """

    placement: Any
    drift: Any
    sole: Array
    J: Array
    base_rows: Array
    torque_rows: Array
    wrench: Array = field(default_factory=lambda: np.zeros((6, 6)))


class FeetFixedDynamics:
    """Equations of motion on fixed feet; extends :class:`FeetFixedKinematics`.

    Call :meth:`update` after that of the kinematics. Attributes are buffers that the
    next update overwrites.

    Attributes:
        mass: Total mass (kg).
        base_rows: (6, n + 12) of (s_ddot, f).
        base_bias: (6,) b; the base rows of eq. 1 are ``base_rows @ x = base_bias``.
        torque_rows: (n, n + 12) of (s_ddot, f).
        torque_bias: (n,) t; joint torques are ``torque_rows @ x + torque_bias`` (Nm).
        foot_bias: (6,) acceleration that the feet would gain relative to each other at
            s_ddot = 0; both stay at rest (eq. 6c) where ``J_feet s_ddot = foot_bias``.
        force_rows: (3, 12) total contact force of f, base axes.
        moment_rows: (3, 12) total moment of f about the CoM, base axes.
    """

    def __init__(self, kinematics: FeetFixedKinematics) -> None:
        self._kinematics = kinematics
        robot = kinematics.robot
        self._left_leg = robot.left_leg
        model = kinematics.model.copy()
        data = model.createData()
        self._model, self._data = model, data
        n = robot.n_joints
        self.mass = kinematics.mass
        self.base_rows = np.zeros((6, n + 12))
        self.base_bias = np.zeros(6)
        self.torque_rows = np.zeros((n, n + 12))
        self.torque_bias = np.zeros(n)
        self.foot_bias = np.zeros(6)
        self.force_rows = np.zeros((3, 12))
        self.moment_rows = np.zeros((3, 12))

        self._damping = np.array(model.damping[6:])
        self._q = pin.neutral(model)
        self._v = np.zeros(model.nv)
        self._gravity = np.zeros(6)
        # Views of Pinocchio's buffers: reading an attribute costs more than using it.
        self._h_base, self._h_joints = data.nle[:6], data.nle[6:]
        self._M_base, self._M_coupling = data.M[:6, :6], data.M[:6, 6:]
        self._M_joints = data.M[6:, 6:]
        self._feet = [self._foot(side, frame) for side, frame in enumerate(robot.sole_frames)]

    def _foot(self, side: int, frame_name: str) -> _Foot:
        frame = self._model.frames[self._model.getFrameId(frame_name)]
        robot = self._kinematics.robot
        first = robot.n_joints + 6 * side
        columns, leg = slice(first, first + 6), (robot.left_leg, robot.right_leg)[side]
        return _Foot(
            placement=self._kinematics.data.oMi[frame.parentJoint],
            drift=self._data.a_gf[frame.parentJoint],
            sole=frame.placement.toDualActionMatrix(),
            J=(self._kinematics.J_left, self._kinematics.J_right)[side],
            base_rows=self.base_rows[:, columns],
            torque_rows=self.torque_rows[leg, columns],
        )

    def __reduce__(self) -> tuple[type[FeetFixedDynamics], tuple[FeetFixedKinematics]]:
        # The buffers are filled anew by the next update.
        return FeetFixedDynamics, (self._kinematics,)

    def update(self, joint_position: Array, joint_velocity: Array) -> None:
        """Recompute all attributes.

        Args:
            joint_position: (n,) rad; the kinematics must be updated for it already.
            joint_velocity: (n,) rad/s.
        """
        model, kinematics = self._model, self._kinematics
        J_left = kinematics.J_left
        # An inertial frame that coincides with the base at this instant.
        gravity = self._gravity
        np.dot(GRAVITY, kinematics.base_rotation, out=gravity[:3])
        model.gravity.linear = gravity[:3]
        self._q[7:] = joint_position
        np.dot(J_left, joint_velocity[self._left_leg], out=self._v[:6])
        np.negative(self._v[:6], out=self._v[:6])
        self._v[6:] = joint_velocity
        pin.nonLinearEffects(model, self._data, self._q, self._v)
        pin.crba(model, self._data, self._q)

        drifts = []
        for foot in self._feet:
            # Pinocchio's a_gf is the acceleration at nu_dot = 0, minus gravity.
            drifts.append(foot.placement.act(foot.drift).vector + gravity)
            np.dot(foot.placement.toDualActionMatrix(), foot.sole, out=foot.wrench)
            np.negative(foot.wrench, out=foot.base_rows)
            np.negative(foot.J.T.dot(foot.wrench), out=foot.torque_rows)
        np.subtract(drifts[1], drifts[0], out=self.foot_bias)

        coupling = self._M_coupling
        n = len(self.torque_bias)
        self.base_rows[:, :n] = coupling
        self.base_rows[:, self._left_leg] -= self._M_base.dot(J_left)
        np.subtract(self._M_base.dot(drifts[0]), self._h_base, out=self.base_bias)
        self.torque_rows[:, :n] = self._M_joints
        self.torque_rows[:, self._left_leg] -= coupling.T.dot(J_left)
        np.subtract(self._h_joints, drifts[0].dot(coupling), out=self.torque_bias)
        self.torque_bias += self._damping * joint_velocity

        np.negative(self.base_rows[:3, n:], out=self.force_rows)
        np.negative(self.base_rows[3:, n:], out=self.moment_rows)
        self.moment_rows -= pin.skew(kinematics.base_p_com).dot(self.force_rows)
