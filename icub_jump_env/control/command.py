"""What a controller hands to the joint servos."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot import facts

Array = NDArray[np.float64]

_AT_REST = np.zeros(facts.N_JOINTS)
_AT_REST.setflags(write=False)


class JointCommand(NamedTuple):
    """Command to the joint servos, valid until the next one; its arrays are its own.

    Attributes:
        velocity: (23,) desired joint velocities (rad/s).
        position: (23,) desired joint positions (rad) now, or ``None`` for velocity
            control, where the servo integrates the velocity itself.
        torque: (23,) joint torques (Nm) for torque control, which passes by position
            and velocity; else ``None``.
    """

    velocity: Array = _AT_REST
    position: Array | None = None
    torque: Array | None = None
