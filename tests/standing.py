"""Random states of a robot with both feet on the floor, and what Pinocchio says of them."""

import numpy as np
import pinocchio as pin

from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.statics import make_stance

ROBOT = load_robot()
STANCE = make_stance(FeetFixedKinematics(ROBOT), ROBOT.crouch)
N = ROBOT.n_joints
MODEL = build_pinocchio_model(ROBOT)
SOLES = [MODEL.getFrameId(frame) for frame in ROBOT.sole_frames]
GRAVITY = np.array([0.0, 0.0, -9.81])


class Standing:
    """The believed state of a standing robot, with a set point.

    Attributes:
        kinematics: The model that the state keeps up to date.
        state: The believed state.
        setpoint: At rest in the crouch with the CoM where it is.
    """

    def __init__(self, seed, spread=0.02):
        self.kinematics = FeetFixedKinematics(ROBOT)
        self._estimator = FeetFixedEstimator(self.kinematics)
        self.setpoint = Setpoint.at_rest(ROBOT.crouch)
        self.move(seed, spread)

    def move(self, seed, spread=0.02):
        """Take another random posture that keeps both feet on the floor."""
        self.rng = rng = np.random.default_rng(seed)
        s = ROBOT.crouch.copy()
        stance = rng.normal(scale=spread, size=6) * [1, 0, 0, 1, 1, 0]
        s[ROBOT.left_leg] += stance
        s[ROBOT.right_leg] += stance
        s[ROBOT.torso] += rng.normal(scale=spread, size=3)
        s[ROBOT.arms] += rng.normal(scale=spread, size=8)
        s = np.clip(s, ROBOT.lower_position + 0.05, ROBOT.upper_position - 0.05)
        # Joint velocities that leave the feet at rest.
        self.kinematics.update(s)
        _, _, Vt = np.linalg.svd(self.kinematics.J_feet)
        self.be(s, Vt[6:].T @ (0.3 * rng.normal(size=N - 6)))

    def be(self, s, s_dot=None):
        """Take the joint positions ``s``, still or with joint velocities."""
        s_dot = np.zeros(N) if s_dot is None else s_dot
        readings = Readings({"n": N}, joint_position=s, joint_velocity=s_dot)
        self.state = self._estimator.estimate(readings)
        self.setpoint.com_position[:] = self.state.com

    def ask(self, size=1.0, posture=0.1):
        """A set point none of whose parts is zero."""
        wanted, rng = self.setpoint, self.rng
        wanted.com_position += 0.002 * size * rng.normal(size=3)
        wanted.com_velocity[:] = 0.05 * size * rng.normal(size=3)
        wanted.com_acceleration[:] = 0.5 * size * rng.normal(size=3)
        wanted.angular_momentum[:] = 0.2 * size * rng.normal(size=3)
        wanted.angular_momentum_rate[:] = 2.0 * size * rng.normal(size=3)
        wanted.posture += posture * rng.normal(size=N)
        wanted.posture_velocity[:] = posture * rng.normal(size=N)
        wanted.posture_acceleration[:] = 2.0 * posture * rng.normal(size=N)
        return wanted


class Oracle:
    """The same state in Pinocchio's floating-base model, with the left foot at rest.

    Attributes:
        q: Configuration.
        nu: Velocities (base, joints).
        J: Jacobians of the soles, each in its own frame.
        drift: Accelerations of the soles at nu_dot = 0.
        placements: Of the soles.
        com: CoM position.
    """

    def __init__(self, standing):
        state = standing.state
        quaternion = pin.Quaternion(state.base_rotation).coeffs()
        base_position = standing.kinematics.base_position
        self.q = np.concatenate((base_position, quaternion, state.joint_position))
        self.base = pin.SE3(state.base_rotation, base_position)
        self.J = [
            pin.computeFrameJacobian(MODEL, MODEL.createData(), self.q, sole) for sole in SOLES
        ]
        self.nu = self.velocity(state.joint_velocity)
        data = MODEL.createData()
        pin.forwardKinematics(MODEL, data, self.q, self.nu, np.zeros(MODEL.nv))
        pin.updateFramePlacements(MODEL, data)
        self.drift = [pin.getFrameAcceleration(MODEL, data, sole).vector for sole in SOLES]
        self.placements = [data.oMf[sole].copy() for sole in SOLES]
        self.com = pin.centerOfMass(MODEL, MODEL.createData(), self.q)
        self.mass = pin.computeTotalMass(MODEL)

    def velocity(self, s_dot):
        """(base, joints) velocities with the left foot at rest."""
        left = self.J[0]
        return np.concatenate((-np.linalg.solve(left[:, :6], left[:, 6:] @ s_dot), s_dot))

    def acceleration(self, s_ddot):
        """(base, joints) accelerations with the left foot at rest."""
        left = self.J[0]
        base = -np.linalg.solve(left[:, :6], left[:, 6:] @ s_ddot + self.drift[0])
        return np.concatenate((base, s_ddot))

    def momentum(self, s_dot):
        """Linear and angular centroidal momentum at joint velocities."""
        nu = self.velocity(s_dot)
        return pin.computeCentroidalMomentum(MODEL, MODEL.createData(), self.q, nu).vector

    def in_base_frame(self, twist):
        """A twist of the right sole in the frame of the base."""
        return self.base.actInv(self.placements[1]).toActionMatrix() @ twist

    def forces(self, s_ddot, f):
        """Generalised forces of the base and the joints, less the contact wrenches' share."""
        nu_dot = self.acceleration(s_ddot)
        forces = pin.rnea(MODEL, MODEL.createData(), self.q, self.nu, nu_dot)
        for J, wrench in zip(self.J, (f[:6], f[6:]), strict=True):
            forces -= J.T @ wrench
        forces[6:] += np.array(MODEL.damping[6:]) * self.nu[6:]
        return forces

    def contact(self, f):
        """Total force of the contact wrenches and their moment about the CoM, world axes."""
        total = np.zeros(6)
        for placement, wrench in zip(self.placements, (f[:6], f[6:]), strict=True):
            force = placement.rotation @ wrench[:3]
            arm = placement.translation - self.com
            total[:3] += force
            total[3:] += placement.rotation @ wrench[3:] + np.cross(arm, force)
        return total
