"""The highest launch that the robot's limits allow, which jumps are measured against."""

from __future__ import annotations

import math
from typing import Any

from icub_jump_env.errors import PlanningError
from icub_jump_env.planning.whole_body.binding import binding
from icub_jump_env.planning.whole_body.launch import LaunchProgram
from icub_jump_env.planning.whole_body.margins import LaunchMargins
from icub_jump_env.robot.icub import FEET_FRICTION

_ANY_ANGLE = (-math.pi, math.pi)

PHYSICAL = LaunchMargins(
    torque=1.0,
    speed=1.0,
    torso_speed=1.0,
    position=0.0,
    ankle=_ANY_ANGLE,
    hip=math.radians(80.0),
    takeoff_hip=math.radians(80.0),
    torso=_ANY_ANGLE,
    shoulder=-math.pi,
    friction=FEET_FRICTION,
    cop=0.0,
    least_load=0.0,
    duration=(0.2, 0.8),
    crouch_com=0.0,
    crouch_height=0.2,
    chest=_ANY_ANGLE,
    takeoff_chest=math.pi,
    forward_speed=0.0,
)
"""The limits themselves, of joints, floor and soles; hips up to where pelvis and thighs touch.

It takes off upwards and without rotation, like a plan, but need not land.
"""

_START = tuple(
    tuple(map(math.radians, degrees))
    for degrees in ((-48, -112, 75, 40, -17, 46), (-17, -69, 52, 6, -35, 45))
)
"""Coordinates (rad) of a crouch and a take-off, between which the search starts; from others it
finds the same."""


def physical_optimum(program: LaunchProgram) -> dict[str, Any]:
    """The highest launch of a robot: its ``height`` (m), and what is ``binding``.

    Args:
        program: The program of the robot; its margins are other ones afterwards.

    Raises:
        PlanningError: If the search finds none.
    """
    program.keep(PHYSICAL)
    launch = program.highest(*_START)
    if not launch.feasible:
        raise PlanningError(f"the physical optimum of {program.model.robot.name} was not found")
    return {"height": round(launch.rise, 6), "binding": binding(program.model, launch, PHYSICAL)}
