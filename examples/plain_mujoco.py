"""The paper's jump in plain MuJoCo, without Gymnasium: the controllers as a library.

    python examples/plain_mujoco.py            # joint velocities, eq. 3
    python examples/plain_mujoco.py torque     # joint torques, eq. 6

The robot's own sensors, servos and main loop stand where MuJoCo's are here.
"""

import argparse

import mujoco
import numpy as np

from icub_jump_env import ResidualConfig, TorqueConfig, VelocityConfig
from icub_jump_env.control.torque import TorqueController
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.planning.minimum_jerk import MinimumJerk
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlanner
from icub_jump_env.robot.frames import mujoco_qpos
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.mujoco_model import build_model
from icub_jump_env.robot.robot import load_robot

STIFFNESS, DAMPING = 1500.0, 50.0  # of the joint servos (Nm/rad, Nm s/rad)
STEP = 0.001  # of the physics (s)


def main(kind: str) -> None:
    """Jump, and say how high the robot rises."""
    robot = load_robot()
    plan = ScaledCurvePlanner(FeetFixedKinematics(robot)).plan(0.04)

    # The controller, its model of the robot, and the estimator that keeps the model up to date.
    kinematics = FeetFixedKinematics(robot)
    estimator = FeetFixedEstimator(kinematics)
    if kind == "velocity":
        config = VelocityConfig()
        controller = VelocityController(config, kinematics)
    else:
        config = TorqueConfig()
        controller = TorqueController(config, kinematics)
    controller.reset(plan.stance)
    reference = Reference(ResidualFilter(ResidualConfig().bandwidth))  # an agent may move it

    # The robot: here MuJoCo's, with a torque motor for each joint.
    model = build_model(robot, STEP)
    data = mujoco.MjData(model)
    data.qpos[:] = mujoco_qpos(plan.stance.configuration)
    mujoco.mj_forward(model, data)
    readings = Readings.of(robot.n_joints)
    position, velocity = robot.crouch.copy(), np.zeros(robot.n_joints)  # what the servos follow
    take_off, highest = None, 0.0

    for tick in range(round(1.5 * config.frequency)):
        time = tick / config.frequency
        readings.joint_position[:] = data.qpos[7:]
        readings.joint_velocity[:] = data.qvel[6:]
        state = estimator.estimate(readings)
        if time < plan.duration:
            if tick == 0:
                reference.start(plan, state.com)  # plans begin where the robot stands
            reference.update(time)
            command = controller.command(state, reference.setpoint)
        else:
            if take_off is None:
                take_off = data.sensor("com").data[2].copy()
                flight = MinimumJerk(
                    data.qpos[7:].copy(), plan.landing_posture, plan.retraction_time
                )
            position, velocity = flight.sample(time - plan.duration)
        for _ in range(round(1.0 / config.frequency / STEP)):
            if time < plan.duration and kind == "velocity":
                velocity = command.velocity
                position = position + STEP * velocity
            servo = STIFFNESS * (position - data.qpos[7:]) + DAMPING * (velocity - data.qvel[6:])
            data.ctrl[:] = command.torque if time < plan.duration and kind == "torque" else servo
            mujoco.mj_step(model, data)
            highest = max(highest, data.sensor("com").data[2])
    upright = data.sensor("com").data[2] > 0.3
    print(f"rise {100 * (highest - take_off):.1f} cm, {'stands' if upright else 'fell'}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", nargs="?", choices=("velocity", "torque"), default="velocity")
    main(parser.parse_args().kind)
