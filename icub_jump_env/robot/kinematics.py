"""Pinocchio model of the iCub and the kinematics of standing on two fixed feet.

The controller estimates the base from the assumption that the soles neither slide nor
rotate (paper, section III-D). With the sole frames at rest the base twist follows
from either leg, so the velocity of the whole robot is a function of the joint
velocities alone; this module computes that function.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot import facts
from icub_jump_env.robot.urdf import load_urdf

Array = NDArray[np.float64]


@functools.cache
def _cached_model(ankle_shift: bool) -> Any:
    model = pin.buildModelFromXML(load_urdf(ankle_shift), pin.JointModelFreeFlyer())
    model.armature[6:] = facts.ARMATURE
    return model


def build_pinocchio_model(ankle_shift: bool = True) -> Any:
    """The floating-base Pinocchio model, with rotor inertias.

    Configuration: base position (m, world), base quaternion xyzw, 23 joints (rad).
    Velocity: linear and angular base velocity in the base frame, 23 joints (rad/s).

    Args:
        ankle_shift: Move the ankle pitch range by -15 deg, as the paper did.

    Returns:
        A ``pinocchio.Model`` of its own, free to be changed by the caller.
    """
    return pin.Model(_cached_model(ankle_shift))


class FeetFixedKinematics:
    """CoM and centroidal momentum as functions of the joints, feet fixed to the floor.

    Call :meth:`update` once per control tick, then read the attributes. They are
    buffers that the next update overwrites. World frame: origin on the floor below
    the middle of the sole frames, +x where the robot faces, +z up.

    Attributes:
        mass: Total mass (kg).
        com: (3,) CoM position W_p_CoM (m).
        J_com: (3, 23) maps joint velocities to the CoM velocity (m/s), world axes.
        J_momentum: (3, 23) maps joint velocities to the centroidal angular momentum
            H_omega (kg m^2/s), world axes; the angular half of J_M in eq. 2.
        J_feet: (6, 23) maps joint velocities to the twist of the right foot relative
            to the left one. Both feet are at rest (eq. 3c) where it vanishes.
        base_rotation: (3, 3) orientation of ``root_link`` in the world.
        base_position: (3,) position of ``root_link`` in the world (m).
    """

    def __init__(self, ankle_shift: bool = True) -> None:
        self._ankle_shift = ankle_shift
        self._model = _cached_model(ankle_shift)
        self._data = self._model.createData()
        self._q = pin.neutral(self._model)
        left, right = (self._model.getFrameId(name) for name in facts.SOLE_FRAMES)
        self._sole_frames = left, right
        frame = self._model.frames[left]
        self._ankle_R_sole = frame.placement.rotation.copy()
        self._ankle_p_sole = frame.placement.translation.copy()

        # Views of Pinocchio's buffers: reading an attribute costs more than using it.
        data = self._data
        self._A_momentum = data.Ag
        self._J = data.J
        self._base_p_com = data.com[0]
        ankle = data.oMi[frame.parentJoint]
        self._base_R_ankle, self._base_p_ankle = ankle.rotation, ankle.translation

        self.mass = float(pin.computeTotalMass(self._model))
        self.com = np.zeros(3)
        self._stacked = np.zeros((2, 3, facts.N_JOINTS))
        self.J_com, self.J_momentum = self._stacked
        self.J_feet = np.zeros((6, facts.N_JOINTS))
        self.base_rotation = np.eye(3)
        self.base_position = np.zeros(3)
        self.world_M_sole = self._start_placement()

    def __reduce__(self) -> tuple[type[FeetFixedKinematics], tuple[bool]]:
        # The buffers are views of Pinocchio's; a copy takes its own at its next update.
        return FeetFixedKinematics, (self._ankle_shift,)

    def _start_placement(self) -> Any:
        """Left sole flat on the floor, the other one mirrored about the x axis."""
        pin.framesForwardKinematics(self._model, self._data, self._q)
        left, right = (self._data.oMf[i] for i in self._sole_frames)
        half_width = abs(float((left.actInv(right)).translation[1])) / 2
        return pin.SE3(np.eye(3), np.array([0.0, half_width, -facts.SOLE.bottom]))

    def update(self, joint_position: Array) -> None:
        """Recompute all attributes.

        Args:
            joint_position: (23,) joint positions (rad).
        """
        # With the base at the origin, its columns of J are the identity, so that the
        # base twist for a left foot at rest is minus the left leg's contribution.
        self._q[7:] = joint_position
        pin.computeCentroidalMap(self._model, self._data, self._q)
        J_left = self._J[:, 6:12]
        self.J_feet[:, facts.LEFT_LEG] = J_left
        self.J_feet[:, facts.RIGHT_LEG] = -self._J[:, 12:18]

        sole = self.world_M_sole
        base_R_sole = self._base_R_ankle @ self._ankle_R_sole
        base_p_sole = self._base_R_ankle @ self._ankle_p_sole + self._base_p_ankle
        R = np.matmul(sole.rotation, base_R_sole.T, out=self.base_rotation)
        self.base_position[:] = sole.translation - R @ base_p_sole
        np.add(R @ self._base_p_com, self.base_position, out=self.com)

        A = self._A_momentum
        joint_map = A[:, 6:].copy()
        joint_map[:, facts.LEFT_LEG] -= A[:, :6] @ J_left
        joint_map[:3] /= self.mass
        np.matmul(R, joint_map.reshape(2, 3, facts.N_JOINTS), out=self._stacked)
