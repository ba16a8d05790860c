"""What most write first: Pinocchio, stacked matrices and qpsolvers with OSQP."""

import sys

import numpy as np
import pinocchio as pin
import qpsolvers
from common import Launch, serve

launch = Launch(sys.argv[1], "velocity")
model = pin.buildModelFromUrdf(launch.urdf, pin.JointModelFreeFlyer())
data = model.createData()
soles = [model.getFrameId(name) for name in ("l_sole", "r_sole")]
n = len(launch.joints)
H = np.diag(np.concatenate((np.full(6, 1e-6), np.full(n, 2.0))))
unbounded = np.full(6, np.inf)


def tick(state: int) -> object:
    """CoM, soles and angular momentum as equalities, posture as cost, joint limits."""
    q, v = launch.q[state], launch.v[state]
    pin.forwardKinematics(model, data, q)
    pin.updateFramePlacements(model, data)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J_soles = [pin.computeFrameJacobian(model, data, q, sole, frame) for sole in soles]
    J_com = pin.jacobianCenterOfMass(model, data, q)
    J_momentum = pin.ccrba(model, data, q, v)[3:]
    A = np.vstack((J_com, *J_soles, J_momentum))
    b = np.concatenate((launch.com_velocity[state], np.zeros(15)))
    g = np.concatenate((np.zeros(6), q[7:] - launch.q[0, 7:]))
    fastest = model.velocityLimit[6:]
    lower = np.maximum(-fastest, (model.lowerPositionLimit[7:] - q[7:]) / 0.01)
    upper = np.minimum(fastest, (model.upperPositionLimit[7:] - q[7:]) / 0.01)
    lower, upper = np.concatenate((-unbounded, lower)), np.concatenate((unbounded, upper))
    return qpsolvers.solve_qp(H, g, None, None, A, b, lower, upper, solver="osqp")


serve({"qpsolvers with OSQP": (launch, tick)})
