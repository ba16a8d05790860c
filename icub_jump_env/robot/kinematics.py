"""Pinocchio model of the iCub and the kinematics of standing on two fixed feet.

The controller estimates the base from the assumption that the soles neither slide nor
rotate (paper, section III-D). With the sole frames at rest the base twist follows
from either leg, so the velocity of the whole robot is a function of the joint
velocities alone; this module computes that function.
"""

from __future__ import annotations

import functools
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation as Turn

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import rotate
from icub_jump_env.records import Array, Block, Number, Record, Rotation, Vector
from icub_jump_env.robot.robot import Robot


@functools.cache
def _cached_model(robot: Robot) -> Any:
    model = pin.buildModelFromXML(robot.urdf(), pin.JointModelFreeFlyer())
    model.armature[6:] = robot.armature
    return model


def build_pinocchio_model(robot: Robot) -> Any:
    """The floating-base Pinocchio model, with rotor inertias.

    Configuration: base position (m, world), base quaternion xyzw, n joints (rad).
    Velocity: linear and angular base velocity in the base frame, n joints (rad/s).

    Returns:
        A ``pinocchio.Model`` of its own, free to be changed by the caller.
    """
    return pin.Model(_cached_model(robot))


class FeetFixedKinematics(Record):
    """CoM and centroidal momentum as functions of the joints, feet fixed to the floor.

    An estimator calls :meth:`update` once per control tick; the attributes are buffers
    that the next update overwrites. World frame: origin on the floor below the middle of the sole
    frames, +x where the robot faces, +z up.

    Attributes:
        robot: The robot; n is the number of its joints.
        mass: Total mass (kg).
        com: (3,) CoM position W_p_CoM (m).
        centroidal_map: (6, n) J_com above J_momentum.
        J_com: (3, n) maps joint velocities to the CoM velocity (m/s), world axes.
        J_momentum: (3, n) maps joint velocities to the centroidal angular momentum
            H_omega (kg m^2/s), world axes; the angular half of J_M in eq. 2.
        J_feet: (6, n) maps joint velocities to the twist of the right foot relative
            to the left one. Both feet are at rest (eq. 3c) where it vanishes.
        base_rotation: (3, 3) orientation of ``root_link`` in the world.
        base_position: (3,) position of ``root_link`` in the world (m).
        base_p_com: (3,) CoM position in the base frame (m).
        A_base: (6, 6) maps the base twist, base axes, to the centroidal momentum in them: linear
            above angular. Its last block is the inertia of the robot as one rigid body.
        A_joints: (6, n) maps joint velocities to the same.
        base_M_ankles: ``pinocchio.SE3`` of the left and right ankle roll joint, base frame.
        ankle_p_soles: (3,) middle of each sole's underside in the frame of its ankle (m).
        J_left: (6, 6) twist of the left foot of the left leg's joints, base frame.
        J_right: (6, 6) the same of the right foot.
        model: The Pinocchio model, shared; do not change it.
        sole_positions: (2, 3) middle of the underside of the left and right sole, both at rest
            on the floor (m).
        world_M_left_sole: ``pinocchio.SE3`` of the left sole frame, which stands still.
        world_M_ankle: Likewise of the left ankle roll joint.
        world_R_ankle, world_p_ankle, total_mass: Rotation and translation of it, and the mass, for
            compiled functions.
    """

    com: Vector
    centroidal_map: Annotated[Array, (6, "n")]
    J_feet: Annotated[Array, (6, "n")]
    base_rotation: Rotation
    base_position: Vector
    world_R_ankle: Rotation
    world_p_ankle: Vector
    total_mass: Number

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model = _cached_model(robot)
        self.data = self.model.createData()
        self._q = pin.neutral(self.model)
        self.mass = float(pin.computeTotalMass(self.model))
        ankle = self._place_left_ankle()
        super().__init__(
            {"n": robot.n_joints},
            base_rotation=np.eye(3),
            world_R_ankle=self.world_M_ankle.rotation,
            world_p_ankle=self.world_M_ankle.translation,
            total_mass=self.mass,
        )
        self.J_com, self.J_momentum = self.centroidal_map[:3], self.centroidal_map[3:]
        # Views of Pinocchio's buffers: reading an attribute costs more than using it.
        data = self.data
        self.A_base, self.A_joints = data.Ag[:, :6], data.Ag[:, 6:]
        self.J_left, self.J_right = data.J[:, 6:12], data.J[:, 12:18]
        self.base_p_com = data.com[0]
        frames = [self.model.frames[self.model.getFrameId(name)] for name in robot.sole_frames]
        self.base_M_ankles = [data.oMi[frame.parentJoint] for frame in frames]
        middle = np.array([robot.sole.center_x, 0.0, robot.sole.bottom])
        self.ankle_p_soles = [frame.placement.act(middle) for frame in frames]
        chest = self.model.frames[self.model.getFrameId(robot.chest_link)]
        self._base_R_spine = data.oMi[chest.parentJoint].rotation
        self._spine_chest_up = chest.placement.rotation[:, 1].copy()
        placement = data.oMi[ankle]
        self._buffers = (
            data.Ag, data.J, placement.rotation, placement.translation, self.base_p_com, self.block,
        )  # fmt: skip

    def __reduce__(self) -> tuple[type[FeetFixedKinematics], tuple[Robot]]:
        # The buffers are views of Pinocchio's; a copy takes its own at its next update.
        return FeetFixedKinematics, (self.robot,)

    def _place_left_ankle(self) -> int:
        """Fix the left sole flat on the floor, half the stance width left of the x axis.

        The sole is welded to the last joint of the leg, so that joint stands still too.
        """
        model, data = self.model, self.data
        pin.framesForwardKinematics(model, data, self._q)
        left, right = (model.getFrameId(name) for name in self.robot.sole_frames)
        stance_width = abs(data.oMf[left].actInv(data.oMf[right]).translation[1])
        sole_position = np.array([0.0, stance_width / 2, -self.robot.sole.bottom])
        self.world_M_left_sole = pin.SE3(np.eye(3), sole_position)
        x, y = self.robot.sole.center_x, stance_width / 2
        self.sole_positions = np.array([[x, y, 0.0], [x, -y, 0.0]])
        frame = model.frames[left]
        self.world_M_ankle = self.world_M_left_sole * frame.placement.inverse()
        return int(frame.parentJoint)

    def configuration(self, posture: Array) -> Array:
        """Pinocchio's configuration (n + 7,) of a posture (n,) (rad), soles on the floor."""
        self.update(posture)
        quaternion = Turn.from_matrix(self.base_rotation).as_quat()
        return np.concatenate((self.base_position, quaternion, posture))

    def chest_up(self) -> Array:
        """(3,) the chest's up axis in the base frame: the y axis of its link."""
        up: Array = self._base_R_spine.dot(self._spine_chest_up)
        return up

    def com_shift(self, posture: Array) -> Array:
        """How the joints shift the CoM with both feet at rest, to first order.

        Args:
            posture: (n,) joint positions (rad).

        Returns:
            (n, 3): the shortest displacement of the joints (rad) per shift of the CoM
            (m) in the world.
        """
        self.update(posture)
        shift: Array = np.linalg.pinv(np.vstack((self.J_feet, self.J_com)))[:, 6:]
        return shift

    def update(self, joint_position: Array) -> None:
        """Recompute all attributes.

        Args:
            joint_position: (n,) joint positions (rad).
        """
        self._q[7:] = joint_position
        pin.computeCentroidalMap(self.model, self.data, self._q)
        stand_on_left_foot(*self._buffers)


@compiled
def stand_on_left_foot(
    A: Array,
    J: Array,
    base_R_ankle: Array,
    base_p_ankle: Array,
    base_p_com: Array,
    kinematics: Block,
) -> None:
    """From a robot whose base is at the origin to one whose left foot stands still.

    Args:
        A: (6, n + 6) centroidal momentum of base twist and joint velocities, base axes.
        J: (6, n + 6) Jacobians of all joints, base axes.
        base_R_ankle: (3, 3) orientation of the left ankle.
        base_p_ankle: (3,) its position (m).
        base_p_com: (3,) position of the CoM (m).
        kinematics: Block of the :class:`FeetFixedKinematics`, which this fills.
    """
    k = kinematics[0]
    n = k.J_feet.shape[1]
    R, p, com = k.base_rotation, k.base_position, k.com
    for i in range(3):
        for j in range(3):
            R[i, j] = (
                k.world_R_ankle[i, 0] * base_R_ankle[j, 0]
                + k.world_R_ankle[i, 1] * base_R_ankle[j, 1]
                + k.world_R_ankle[i, 2] * base_R_ankle[j, 2]
            )
    rotate(R, base_p_ankle, p)
    rotate(R, base_p_com, com)
    for i in range(3):
        p[i] = k.world_p_ankle[i] - p[i]
        com[i] += p[i]

    # With the base at the origin, its columns of J are the identity, so that the base twist for a
    # left foot at rest is minus the left leg's contribution. The legs' joints come first.
    joints = np.empty((6, n))
    for i in range(6):
        for j in range(n):
            joints[i, j] = A[i, 6 + j]
        for j in range(6):
            for row in range(6):
                joints[i, j] -= A[i, row] * J[row, 6 + j]
            k.J_feet[i, j] = J[i, 6 + j]
            k.J_feet[i, 6 + j] = -J[i, 12 + j]
    for half in range(2):
        scale = 1.0 if half else 1.0 / k.total_mass
        for i in range(3):
            for j in range(n):
                k.centroidal_map[3 * half + i, j] = scale * (
                    R[i, 0] * joints[3 * half, j]
                    + R[i, 1] * joints[3 * half + 1, j]
                    + R[i, 2] * joints[3 * half + 2, j]
                )
