"""What the controller would have commanded on a recorded launch: it runs on a log, not on a robot.

    icub-jump export jump jump.csv
    python examples/replay_log.py jump.csv

The log has a row for each control tick; of it only what the encoders said is used.
"""

import math
import sys
from pathlib import Path

import numpy as np

from icub_jump_env import ResidualConfig, VelocityConfig
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.export.tables import read_table
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlanner
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot


def main(path: Path) -> None:
    """Replay, and say how far the commands are from those of the log."""
    log, robot = read_table(path), load_robot()

    def recorded(name: str) -> np.ndarray:
        return np.transpose([log[f"{name}.{joint}"] for joint in robot.joint_names])

    position, velocity = recorded("encoder_position"), recorded("encoder_velocity")
    commanded = recorded("joint_velocity_command")

    plan = ScaledCurvePlanner(FeetFixedKinematics(robot)).plan(0.04)
    kinematics = FeetFixedKinematics(robot)
    estimator = FeetFixedEstimator(kinematics)
    controller = VelocityController(VelocityConfig(), kinematics)
    controller.reset(plan.stance)
    reference = Reference(ResidualFilter(ResidualConfig().bandwidth))
    readings, differences = Readings.of(robot.n_joints), []
    for tick in range(math.ceil(plan.duration * VelocityConfig().frequency)):
        time = tick / VelocityConfig().frequency
        readings.joint_position[:], readings.joint_velocity[:] = position[tick], velocity[tick]
        state = estimator.estimate(readings)
        if tick == 0:
            reference.start(plan, state.com)
        reference.update(time)
        command = controller.command(state, reference.setpoint)
        differences.append(np.abs(command.velocity - commanded[tick + 1]).max())
    print(f"{len(differences)} ticks, largest difference {max(differences):.1e} rad/s")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
