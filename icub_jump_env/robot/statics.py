"""Standing at rest on two feet: a posture and the joint torques that hold it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float64]


class Stance(NamedTuple):
    """A posture with both soles flat on the floor.

    Attributes:
        posture: (n,) joint positions (rad).
        configuration: (n + 7,) Pinocchio configuration.
        torque: (n,) joint torques that hold it against gravity (Nm); the contact wrenches
            are the smallest ones (least norm) that carry the weight.
    """

    posture: Array
    configuration: Array
    torque: Array


def make_stance(kinematics: FeetFixedKinematics, posture: Array) -> Stance:
    """The stance in a posture (n,) (rad); the kinematics are updated for it."""
    q = kinematics.configuration(posture)
    model, data = kinematics.model, kinematics.model.createData()
    gravity = pin.computeGeneralizedGravity(model, data, q)
    jacobians = [
        pin.computeFrameJacobian(model, data, q, model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
        for name in kinematics.robot.sole_frames
    ]
    J = np.vstack(jacobians)
    wrenches = np.linalg.lstsq(J[:, :6].T, gravity[:6], rcond=None)[0]
    return Stance(posture, q, (gravity - J.T @ wrenches)[6:])
