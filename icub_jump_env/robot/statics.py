"""Joint torques that hold a posture on two feet."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot.kinematics import build_pinocchio_model
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]


def holding_torque(robot: Robot, q: Array) -> Array:
    """Torques that balance gravity with both soles on the floor.

    The contact wrenches are the smallest ones (least norm) that carry the weight.

    Args:
        robot: The robot.
        q: (n + 7,) Pinocchio configuration.

    Returns:
        (n,) joint torques (Nm).
    """
    model = build_pinocchio_model(robot)
    data = model.createData()
    gravity = pin.computeGeneralizedGravity(model, data, q)
    jacobians = [
        pin.computeFrameJacobian(model, data, q, model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
        for name in robot.sole_frames
    ]
    J = np.vstack(jacobians)
    wrenches = np.linalg.lstsq(J[:, :6].T, gravity[:6], rcond=None)[0]
    torque: Array = (gravity - J.T @ wrenches)[6:]
    return torque
