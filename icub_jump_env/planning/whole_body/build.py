"""Making a family of plans: the only code here that needs CasADi."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import PlanningError
from icub_jump_env.planning.whole_body.binding import binding
from icub_jump_env.planning.whole_body.family import FORMAT, PlanFamily, model_hash
from icub_jump_env.planning.whole_body.landing import LandingProgram
from icub_jump_env.planning.whole_body.launch import Launch, LaunchProgram
from icub_jump_env.planning.whole_body.margins import (
    RETRACTION_SHARE,
    Branch,
    FamilyMargins,
    LandingMargins,
)
from icub_jump_env.planning.whole_body.optimum import physical_optimum
from icub_jump_env.planning.whole_body.sagittal import SagittalModel, selection
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]


def build_family(robot: Robot, controller: str, margins: FamilyMargins) -> PlanFamily:
    """Optimise the plans of a robot.

    Their ``rise`` is that of the plan; :func:`icub_jump_env.evaluation.calibration.calibrate`
    replaces it with what the controller makes of it.

    Raises:
        PlanningError: If a branch has no plan.
    """
    model = SagittalModel(robot, margins.shoulder_roll)
    program = LaunchProgram(model, margins.branches[0].launch)
    launches = [
        (index, launch)
        for index, branch in enumerate(margins.branches)
        for launch in _branch(program, branch)
    ]
    programs: dict[LandingMargins | None, LandingProgram] = {
        branch.landing: LandingProgram(model, branch.landing)
        for branch in margins.branches
        if branch.landing is not None
    }
    landings = [
        _landing(launch, programs.get(margins.branches[index].landing), robot)
        for index, launch in launches
    ]
    S = selection(robot)
    card: dict[str, Any] = {
        "format": FORMAT,
        "robot": robot.name,
        "controller": controller,
        "model": model_hash(robot),
        "margins": dataclasses.asdict(margins),
        "versions": {name: version(name) for name in ("casadi", "numpy", "pin")},
        "optimum": physical_optimum(program),
        "plans": [
            {
                "height": round(launch.rise, 6),
                "binding": binding(model, launch, margins.branches[index].launch),
                "iterations": launch.iterations,
                "violation": launch.violation,
            }
            for index, launch in launches
        ],
    }
    return PlanFamily(
        rise=np.array([launch.rise for _, launch in launches]),
        branch=np.array([index for index, _ in launches]),
        duration=np.array([launch.duration for _, launch in launches]),
        position=np.array([model.posture(launch.q) for _, launch in launches]),
        velocity=np.array([launch.v @ S.T for _, launch in launches]),
        acceleration=np.array([launch.a @ S.T for _, launch in launches]),
        landing=np.array([posture for posture, _ in landings]),
        retraction=np.array([duration for _, duration in landings]),
        card=card,
    )


def _branch(program: LaunchProgram, branch: Branch) -> list[Launch]:
    """The launches of a branch, from low to high."""
    robot = program.model.robot
    program.keep(branch.launch)
    found = [program.highest(crouch, takeoff) for crouch, takeoff in branch.starts]
    highest = max((launch for launch in found if launch.feasible), key=_rise, default=None)
    if highest is None:
        raise PlanningError(f"no launch of {robot.name} keeps the limits")
    launches = [highest]
    # Each search starts at the plan above, so that the family is smooth.
    for height in _heights(branch, highest.rise):
        launches.append(program.to_height(height, launches[-1], highest.q[0]))
        if not launches[-1].feasible:
            raise PlanningError(f"no launch of {robot.name} to {100 * height:.1f} cm was found")
    return [launch for launch in reversed(launches) if launch.rise < branch.highest + 1e-4]


def _landing(launch: Launch, program: LandingProgram | None, robot: Robot) -> tuple[Array, float]:
    """The posture of flight and landing ((n,) rad), and the duration of the motion to it (s).

    Without a program they are the paper's.
    """
    if program is not None:
        return program.model.posture(program.solve(launch)), program.margins.retraction
    flight = 2 * math.sqrt(2 * launch.rise / GRAVITY)
    return robot.landing, RETRACTION_SHARE * flight


def _rise(launch: Launch) -> float:
    return launch.rise


def _heights(branch: Branch, reached: float) -> Iterator[float]:
    """From what is reached down: the highest of a branch, multiples of the step, the lowest."""
    step, top = branch.step, min(reached, branch.highest)
    if top < reached:
        yield top
    for k in itertools.count(int(top / step), -1):
        height = k * step
        if height <= branch.lowest + step / 4:
            yield branch.lowest
            return
        if height < top - step / 4:
            yield height
