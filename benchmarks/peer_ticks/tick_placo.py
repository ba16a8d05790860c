"""Placo: kinematics with CoM, soles and momentum as constraints; dynamics with planar contacts."""

import sys
from collections.abc import Callable

import numpy as np
import placo
from common import Launch, serve


def kinematics(launch: Launch) -> Callable[[int], object]:
    """CoM, both soles and angular momentum are hard, the posture is soft, joint limits hold."""
    robot = placo.RobotWrapper(launch.urdf, placo.Flags.ignore_collisions)
    solver = placo.KinematicsSolver(robot)
    solver.dt = launch.dt
    robot.state.q = launch.q[0].copy()
    robot.update_kinematics()
    com = solver.add_com_task(robot.com_world())
    com.configure("com", "hard", 1.0)
    soles = {}
    for name in ("l_sole", "r_sole"):
        soles[name] = solver.add_frame_task(name, robot.get_T_world_frame(name))
        soles[name].configure(name, "hard", 1.0, 1.0)
    momentum = solver.add_centroidal_momentum_task(np.zeros(3))
    momentum.configure("momentum", "hard", 1.0)
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(launch.joints, launch.q[0, 7:].tolist(), strict=True)))
    posture.configure("posture", "soft", 1e-2)
    solver.enable_joint_limits(True)
    solver.enable_velocity_limits(True)
    solver.add_regularization_task(1e-6)

    def tick(state: int) -> object:
        robot.state.q = launch.q[state]
        robot.update_kinematics()
        for name, task in soles.items():
            task.T_world_frame = robot.get_T_world_frame(name)
        com.target_world = robot.com_world() + launch.com_velocity[state] * launch.dt
        try:
            return solver.solve(False)
        except RuntimeError:
            return None  # infeasible

    return tick


def dynamics(launch: Launch) -> Callable[[int], object]:
    """Soles are planar contacts and hard, CoM and posture soft, torque limits hold."""
    robot = placo.RobotWrapper(launch.urdf, placo.Flags.ignore_collisions)
    robot.state.q = launch.q[0].copy()
    robot.update_kinematics()
    solver = placo.DynamicsSolver(robot)
    solver.dt = launch.dt
    for name in ("l_sole", "r_sole"):
        sole = solver.add_frame_task(name, robot.get_T_world_frame(name))
        sole.configure(name, "hard", 1.0, 1.0)
        contact = solver.add_planar_contact(sole)
        contact.length, contact.width, contact.mu = 0.16, 0.072, 1 / 3
        contact.weight_forces = contact.weight_moments = 1e-6
    com = solver.add_com_task(robot.com_world())
    com.configure("com", "soft", 1.0)
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(launch.joints, launch.q[0, 7:].tolist(), strict=True)))
    posture.configure("posture", "soft", 1e-2)
    solver.enable_torque_limits(True)
    solver.enable_joint_limits(False)

    def tick(state: int) -> object:
        robot.state.q, robot.state.qd = launch.q[state], launch.v[state]
        robot.update_kinematics()
        com.ddtarget_world = launch.com_acceleration[state]
        return solver.solve(False).tau

    return tick


velocity, torque = Launch(sys.argv[1], "velocity"), Launch(sys.argv[1], "torque")
serve(
    {
        "placo kinematics": (velocity, kinematics(velocity)),
        "placo dynamics": (torque, dynamics(torque)),
    }
)
