"""The iCub in its sagittal plane, as CasADi functions: what a plan is optimised with.

Left and right move alike and all other joints stay where the crouch has them, which leaves six
coordinates. Kinematics are those of the full Pinocchio model with the soles flat on the floor;
the dynamics follow from them by differentiation and the principle of virtual power, so they are
those of the full model, too, up to what a lateral asymmetry of its inertias adds to the torques.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot import icub
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]

COORDINATES = ("ankle_pitch", "knee", "hip_pitch", "torso_pitch", "shoulder_pitch", "elbow")
"""The coordinates: joints of both sides, and the torso."""

ANKLE, KNEE, HIP, TORSO, SHOULDER, ELBOW = range(len(COORDINATES))

_GRAVITY = np.array([0.0, 0.0, -icub.GRAVITY])


def selection(robot: Robot) -> Array:
    """Matrix (n, 6) that makes joint velocities of the rates of the coordinates."""
    S = np.zeros((robot.n_joints, len(COORDINATES)))
    for column, coordinate in enumerate(COORDINATES):
        for row, joint in enumerate(robot.joint_names):
            S[row, column] = joint in (coordinate, f"l_{coordinate}", f"r_{coordinate}")
    return S


def coordinates(robot: Robot, posture: Array) -> Array:
    """The coordinates (..., 6) of symmetric postures (..., n) (rad)."""
    return posture[..., np.argmax(selection(robot), axis=0)]


def chest_pitch(q: Any) -> Any:
    """Pitch of the chest (rad) with the soles level, of coordinates (6, ...)."""
    return -q[ANKLE, :] + q[KNEE, :] + q[HIP, :] + q[TORSO, :]


class _Joint(NamedTuple):
    """A joint between two bodies: its constant placement in the parent, its axis, its rates.

    Attributes:
        rotation: (3, 3) of the joint frame at q = 0.
        position: (3,) of the joint frame (m).
        axis: (3,) unit axis in the joint frame.
        q, v, a: Coordinate and rates.
    """

    rotation: Array
    position: Array
    axis: Array
    q: ca.SX
    v: ca.SX
    a: ca.SX


class _Motion(NamedTuple):
    """Motion of a joint frame in the world: pose, twist and acceleration of its origin."""

    rotation: ca.SX
    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    spin: ca.SX
    spin_rate: ca.SX

    def outward(self, joint: _Joint) -> _Motion:
        """That of the body that the joint carries."""
        R = self.rotation @ joint.rotation @ _rotation(joint.axis, joint.q)
        axis = R @ joint.axis
        arm = self.rotation @ joint.position
        return _Motion(
            rotation=R,
            position=self.position + arm,
            velocity=self.velocity + ca.cross(self.spin, arm),
            acceleration=self.acceleration + _lever(self.spin, self.spin_rate, arm),
            spin=self.spin + axis * joint.v,
            spin_rate=self.spin_rate + axis * joint.a + ca.cross(self.spin, axis * joint.v),
        )

    def inward(self, joint: _Joint) -> _Motion:
        """That of the body that carries the joint."""
        axis = self.rotation @ joint.axis
        R = self.rotation @ _rotation(joint.axis, joint.q).T @ joint.rotation.T
        spin = self.spin - axis * joint.v
        spin_rate = self.spin_rate - axis * joint.a - ca.cross(spin, axis * joint.v)
        arm = R @ joint.position
        return _Motion(
            rotation=R,
            position=self.position - arm,
            velocity=self.velocity - ca.cross(spin, arm),
            acceleration=self.acceleration - _lever(spin, spin_rate, arm),
            spin=spin,
            spin_rate=spin_rate,
        )


def _lever(spin: ca.SX, spin_rate: ca.SX, arm: ca.SX) -> ca.SX:
    """Acceleration at the end of a rotating arm, relative to its other end."""
    return ca.cross(spin_rate, arm) + ca.cross(spin, ca.cross(spin, arm))


class SagittalModel:
    """Symbolic model in six coordinates.

    Attributes:
        robot: The robot.
        mass: Total mass (kg).
        frame: (n,) joints that do not move (rad).
        dynamics: Function of q, v, a ((6,) rad, rad/s, rad/s^2), with the outputs

            - ``torque`` (6,): of each joint, armature and damping included (Nm);
            - ``force`` (2,): of the ground on both feet, forward and up (N);
            - ``moment``: of the ground about the y axis through the origin (Nm);
            - ``com``, ``com_velocity`` (2,): forward and up (m, m/s);
            - ``momentum``, ``momentum_rate``: centroidal, about +y (kg m^2/s, Nm);
            - ``inertia``: centroidal, of the locked joints, about +y (kg m^2).
    """

    def __init__(self, robot: Robot, shoulder_roll: float) -> None:
        self.robot = robot
        self.frame = icub.posture(shoulder_roll=math.degrees(shoulder_roll))
        self._kinematics = FeetFixedKinematics(robot)
        self.mass = self._kinematics.mass
        self.dynamics = self._make_dynamics()

    def posture(self, q: Array) -> Array:
        """Postures (..., n) with coordinates q (..., 6) (rad)."""
        return self.frame + q @ selection(self.robot).T

    def _reduced_model(self) -> Any:
        """Pinocchio's model without the joints that do not move."""
        robot, full = self.robot, self._kinematics.model
        still = np.flatnonzero(selection(robot).sum(axis=1) == 0)
        locked = [full.getJointId(robot.joint_names[k]) for k in still]
        return pin.buildReducedModel(full, locked, self._kinematics.configuration(self.frame))

    def _make_dynamics(self) -> ca.Function:
        q, v, a = (ca.SX.sym(name, len(COORDINATES)) for name in "qva")
        model = self._reduced_model()
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        joints = {}
        for index in range(2, model.njoints):
            placement = model.jointPlacements[index]
            jacobian = pin.getJointJacobian(model, data, index, pin.LOCAL)
            k = COORDINATES.index(model.names[index].removeprefix("l_").removeprefix("r_"))
            joints[index] = _Joint(
                placement.rotation,
                placement.translation,
                jacobian[3:, model.joints[index].idx_v],
                q[k],
                v[k],
                a[k],
            )
        # Inward along the left leg, whose foot stands still, then outward to everything.
        sole = model.frames[model.getFrameId(self.robot.sole_frames[0])]
        foot = self._kinematics.world_M_left_sole * sole.placement.inverse()
        rest = ca.SX.zeros(3)
        motion = _Motion(ca.SX(foot.rotation), ca.SX(foot.translation), rest, rest, rest, rest)
        index = sole.parentJoint
        while index > 1:
            motion = motion.inward(joints[index])
            index = model.parents[index]
        motions = {1: motion}
        for index, joint in joints.items():
            motions[index] = motions[model.parents[index]].outward(joint)

        masses, centers, velocities, spins, forces, moments, inertias = [], [], [], [], [], [], []
        for index, body in motions.items():
            inertia = model.inertias[index]
            arm = body.rotation @ inertia.lever
            rotational = body.rotation @ inertia.inertia @ body.rotation.T
            acceleration = body.acceleration + _lever(body.spin, body.spin_rate, arm)
            masses.append(inertia.mass)
            centers.append(body.position + arm)
            velocities.append(body.velocity + ca.cross(body.spin, arm))
            spins.append(body.spin)
            inertias.append(rotational)
            forces.append(inertia.mass * (acceleration - _GRAVITY))
            angular = rotational @ body.spin
            moments.append(rotational @ body.spin_rate + ca.cross(body.spin, angular))
        bodies = list(zip(masses, centers, velocities, inertias, spins, strict=True))
        com = sum(m * center for m, center, *_ in bodies) / self.mass
        com_velocity = sum(m * velocity for m, _, velocity, *_ in bodies) / self.mass
        momentum = sum(
            inertia @ spin + m * ca.cross(center - com, velocity - com_velocity)
            for m, center, velocity, inertia, spin in bodies
        )[1]
        locked = sum(
            inertia[1, 1] + m * ca.sumsqr((center - com)[[0, 2]])
            for m, center, _, inertia, _ in bodies
        )
        force = sum(forces)
        moment = sum(
            n + ca.cross(center, f) for n, center, f in zip(moments, centers, forces, strict=True)
        )[1]
        # Virtual work: the ground does none on feet at rest.
        work = ca.jtimes(ca.vertcat(*centers), q, ca.vertcat(*forces), True)
        work += ca.jtimes(ca.vertcat(*spins), v, ca.vertcat(*moments), True)
        robot = self.robot
        motors = selection(robot).sum(axis=0)
        armature = coordinates(robot, robot.armature)
        damping = coordinates(robot, np.array(self._kinematics.model.damping[6:]))
        outputs = {
            "torque": work / motors + armature * a + damping * v,
            "force": force[[0, 2]],
            "moment": moment,
            "com": com[[0, 2]],
            "com_velocity": com_velocity[[0, 2]],
            "momentum": momentum,
            "momentum_rate": moment - (com[2] * force[0] - com[0] * force[2]),
            "inertia": locked,
        }
        values = ca.cse([ca.densify(value) for value in outputs.values()])
        return ca.Function("dynamics", [q, v, a], values, ["q", "v", "a"], list(outputs))


def _rotation(axis: Array, angle: ca.SX) -> ca.SX:
    """Rotation by ``angle`` about a unit ``axis`` (Rodrigues)."""
    K = pin.skew(axis)
    rotation: ca.SX = ca.SX.eye(3) + ca.sin(angle) * K + (1 - ca.cos(angle)) * (K @ K)
    return rotation


def stopping_inertia(robot: Robot) -> Array:
    """Inertia (6,) that one motor of each coordinate has to stop in the air (kg m^2).

    That of the joint-space inertia matrix at the landing posture with the base free, of one
    of the two sides.
    """
    kinematics = FeetFixedKinematics(robot)
    model = kinematics.model
    q = kinematics.configuration(robot.landing)
    M = pin.crba(model, model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    S = selection(robot)
    joints, coupling = S.T @ M[6:, 6:] @ S, M[:6, 6:] @ S
    free = joints - coupling.T @ np.linalg.solve(M[:6, :6], coupling)
    inertia: Array = np.diag(free) / S.sum(axis=0)
    return inertia
