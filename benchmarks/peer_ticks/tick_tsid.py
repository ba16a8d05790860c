"""TSID: contacts hard; CoM, angular momentum and posture weighted; torque and joint bounds."""

import sys

import numpy as np
import pinocchio as pin
from common import Launch, serve
from tsid import tsid_pywrap as tsid

launch = Launch(sys.argv[1], "torque")
robot = tsid.RobotWrapper(launch.urdf, pin.StdVec_StdString(), pin.JointModelFreeFlyer(), False)
model, n = robot.model(), len(launch.joints)
problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
problem.computeProblemData(0.0, launch.q[0], launch.v[0])
data = problem.data()
corners = np.array(
    [[0.1065, 0.1065, -0.0535, -0.0535], [0.036, -0.036, 0.036, -0.036], [0.0, 0.0, 0.0, 0.0]]
)
contacts = []
for frame in ("l_sole", "r_sole"):
    contact = tsid.Contact6d(
        frame, robot, frame, corners, np.array([0.0, 0.0, 1.0]), 1 / 3, 5.0, 2000.0
    )
    contact.setKp(10 * np.ones(6))
    contact.setKd(6 * np.ones(6))
    contact.setReference(robot.framePosition(data, model.getFrameId(frame)))
    problem.addRigidContact(contact, 1e-5, 1.0, 0)
    contacts.append(contact)

com = tsid.TaskComEquality("com", robot)
com.setKp(50 * np.ones(3))
com.setKd(14 * np.ones(3))
problem.addMotionTask(com, 1.0, 1, 0.0)
target = tsid.TrajectorySample(3)
momentum = tsid.TaskAMEquality("momentum", robot)
momentum.setKp(np.zeros(3))
momentum.setKd(np.ones(3))
momentum.setReference(tsid.TrajectoryEuclidianConstant("momentum", np.zeros(3)).computeNext())
problem.addMotionTask(momentum, 1e-2, 1, 0.0)
posture = tsid.TaskJointPosture("posture", robot)
posture.setKp(50 * np.ones(n))
posture.setKd(14 * np.ones(n))
posture.setReference(tsid.TrajectoryEuclidianConstant("posture", launch.q[0, 7:]).computeNext())
problem.addMotionTask(posture, 1e-2, 1, 0.0)

torques = tsid.TaskActuationBounds("torques", robot)
torques.setBounds(-model.effortLimit[6:], model.effortLimit[6:])
problem.addActuationTask(torques, 1.0, 0, 0.0)
joints = tsid.TaskJointPosVelAccBounds("joints", robot, 0.01, False)
joints.setPositionBounds(model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
joints.setVelocityBounds(model.velocityLimit[6:])
joints.setAccelerationBounds(500 * np.ones(n))
joints.setImposeBounds(True, True, False, True)
problem.addMotionTask(joints, 1.0, 0, 0.0)
solver = tsid.SolverHQuadProgFast("solver")
solver.resize(problem.nVar, problem.nEq, problem.nIn)


def tick(state: int) -> object:
    """As TSID's exercises: references, problem data, solve, torques."""
    target.pos(robot.com(data))
    target.vel(launch.com_velocity[state])
    target.acc(launch.com_acceleration[state])
    com.setReference(target)
    hierarchy = problem.computeProblemData(state * launch.dt, launch.q[state], launch.v[state])
    solution = solver.solve(hierarchy)
    return problem.getActuatorForces(solution) if solution.status == 0 else None


serve({"tsid": (launch, tick)})
