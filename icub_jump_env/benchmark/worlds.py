"""Worlds that disturb the robot in one way, beside those of ``randomization``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from icub_jump_env.simulation.randomization import RANDOMIZATIONS, Randomization

HARD, DEG = RANDOMIZATIONS["hard"], math.radians(1.0)

WORLDS: Mapping[str, Randomization] = MappingProxyType(
    {
        "pushed": replace(
            HARD,
            push=(-6.0, 6.0),
            flight_push=(-6.0, 6.0),
            landing_push=(-8.0, 8.0),
            landing_push_time=(0.1, 0.8),
        ),
        "lateral": replace(
            HARD,
            lateral_slope=(-3.0 * DEG, 3.0 * DEG),
            push=(-6.0, 6.0),
            push_direction=(math.pi / 2, math.pi / 2),
            landing_push=(-8.0, 8.0),
            landing_push_direction=(math.pi / 2, math.pi / 2),
        ),
        "landing": replace(
            HARD,
            takeoff_spin=(-0.2, 0.2),
            floor_tilt=(-5.0 * DEG, 5.0 * DEG),
            floor_tilt_lateral=(-3.0 * DEG, 3.0 * DEG),
            edge=(-0.02, 0.02),
            step=(0.0, 0.02),
        ),
    }
)
"""All of them ``hard``, and beside that: pushes at any time; slopes and pushes sideways; rotation at
lift-off, tilted and uneven ground to land on."""
