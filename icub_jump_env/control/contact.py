"""What a sole can transmit: friction cone, unilateral force, centre of pressure (6f)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_number
from icub_jump_env.robot import facts


@dataclass(frozen=True)
class ContactLimits:
    """Limits of the contact wrench of one sole.

    Attributes:
        friction: Coulomb friction that the controller counts on, less than the floor's
            0.8 to keep a margin.
        torsional_friction: Largest yaw moment per normal force (m); our assumption.
        minimum_force: Smallest normal force of each foot (N).

    Raises:
        ConfigError: If a value is out of range.
    """

    friction: float = 0.5
    torsional_friction: float = 0.02
    minimum_force: float = 10.0

    def __post_init__(self) -> None:
        check_number("friction", self.friction, 0.0, 5.0)
        check_number("torsional_friction", self.torsional_friction, 0.0, 1.0)
        check_number("minimum_force", self.minimum_force, 0.0, 1e3)


def contact_rows(limits: ContactLimits) -> NDArray[np.float64]:
    """Rows of C f <= 0 for the wrench f = (force, moment) in a sole frame.

    The friction cone is a pyramid with sides along x and y. The moment is about the
    origin of the sole frame, the centre of pressure lies in the plane of the sole.

    Returns:
        (10, 6): four of friction, four of the CoP, two of torsion.
    """
    sole, mu = facts.SOLE, limits.friction
    z = sole.bottom
    # CoP: x = (z F_x - M_y) / F_z and y = (z F_y + M_x) / F_z, inside the sole.
    return np.array(
        [
            [1.0, 0.0, -mu, 0.0, 0.0, 0.0],
            [-1.0, 0.0, -mu, 0.0, 0.0, 0.0],
            [0.0, 1.0, -mu, 0.0, 0.0, 0.0],
            [0.0, -1.0, -mu, 0.0, 0.0, 0.0],
            [z, 0.0, -sole.x_max, 0.0, -1.0, 0.0],
            [-z, 0.0, sole.x_min, 0.0, 1.0, 0.0],
            [0.0, z, -sole.half_width, 1.0, 0.0, 0.0],
            [0.0, -z, -sole.half_width, -1.0, 0.0, 0.0],
            [0.0, 0.0, -limits.torsional_friction, 0.0, 0.0, 1.0],
            [0.0, 0.0, -limits.torsional_friction, 0.0, 0.0, -1.0],
        ]
    )
