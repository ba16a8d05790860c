"""What a sole can transmit: friction cone, unilateral force, centre of pressure (6f)."""

from __future__ import annotations

import numpy as np

from icub_jump_env.control.config import ContactConfig
from icub_jump_env.control.qp.problem import UNBOUNDED
from icub_jump_env.records import Array
from icub_jump_env.robot.icub import Sole


def limit_wrenches(
    config: ContactConfig, sole: Sole, rows: Array, lower: Array, upper: Array, least: Array
) -> None:
    """C u <= b for both feet, eq. (6f), with a least normal force; it never changes.

    Args:
        config: Friction, torsion, least force.
        sole: Shape of the soles.
        rows: (20, 12) of the wrenches of both feet.
        lower: (20,) bounds of these rows.
        upper: (20,)
        least: (12,) lower bounds of the wrenches themselves.
    """
    cone = contact_rows(config, sole)
    rows[:10, :6] = rows[10:, 6:] = cone
    lower[:], upper[:] = -UNBOUNDED, 0.0
    least[[2, 8]] = config.minimum_force


def contact_rows(config: ContactConfig, sole: Sole) -> Array:
    """Rows of C f <= 0 for the wrench f = (force, moment) in a sole frame.

    The friction cone is a pyramid with sides along x and y. The moment is about the
    origin of the sole frame, the centre of pressure lies in the plane of the sole.

    Returns:
        (10, 6): four of friction, four of the CoP, two of torsion.
    """
    mu, torsion = config.friction, config.torsional_friction
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
            [0.0, 0.0, -torsion, 0.0, 0.0, 1.0],
            [0.0, 0.0, -torsion, 0.0, 0.0, -1.0],
        ]
    )
