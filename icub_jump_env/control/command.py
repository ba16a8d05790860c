"""What a controller hands to the joint servos."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class JointCommand(NamedTuple):
    """Command to the joint servos, valid until the next one; its arrays are its own.

    Attributes:
        velocity: (n,) desired joint velocities (rad/s); ``None`` means rest.
        position: (n,) desired joint positions (rad) now, or ``None`` for velocity
            control, where the servo integrates the velocity itself.
        torque: (n,) joint torques (Nm) for torque control, which passes by position
            and velocity; NaN for joints that stay with the servo, ``None`` if all do.
    """

    velocity: Array | None = None
    position: Array | None = None
    torque: Array | None = None
