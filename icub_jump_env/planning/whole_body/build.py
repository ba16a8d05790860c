"""Making a family of plans: the only code here that needs CasADi."""

from __future__ import annotations

import dataclasses
import itertools
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
from icub_jump_env.planning.whole_body.margins import Branch, FamilyMargins
from icub_jump_env.planning.whole_body.optimum import physical_optimum
from icub_jump_env.planning.whole_body.sagittal import SagittalModel, selection
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]


def build_family(robot: Robot, controller: str, margins: FamilyMargins) -> PlanFamily:
    """Optimise the plans of a robot.

    Their ``rise`` is that of the plan; :func:`icub_jump_env.evaluation.calibration.calibrate`
    replaces it with what the controller makes of it.

    Raises:
        PlanningError: If a branch has no plan.
    """
    plans = [
        (index, model, launch, landing)
        for index, branch in enumerate(margins.branches)
        for model, launch, landing in _branch(robot, branch, margins)
    ]
    S = selection(robot)
    card: dict[str, Any] = {
        "format": FORMAT,
        "robot": robot.name,
        "controller": controller,
        "model": model_hash(robot),
        "margins": dataclasses.asdict(margins),
        "versions": {name: version(name) for name in ("casadi", "numpy", "pin")},
        "optimum": physical_optimum(robot),
        "plans": [
            {
                "height": round(launch.rise, 6),
                "binding": binding(model, launch, margins.branches[index].launch),
                "iterations": launch.iterations,
                "violation": launch.violation,
            }
            for index, model, launch, _ in plans
        ],
    }
    return PlanFamily(
        rise=np.array([launch.rise for _, _, launch, _ in plans]),
        branch=np.array([index for index, *_ in plans]),
        duration=np.array([launch.duration for _, _, launch, _ in plans]),
        position=np.array([model.posture(launch.q) for _, model, launch, _ in plans]),
        velocity=np.array([launch.v @ S.T for _, _, launch, _ in plans]),
        acceleration=np.array([launch.a @ S.T for _, _, launch, _ in plans]),
        landing=np.array([model.posture(landing) for _, model, _, landing in plans]),
        retraction=np.full(len(plans), margins.landing.retraction),
        card=card,
    )


def _branch(
    robot: Robot, branch: Branch, margins: FamilyMargins
) -> Iterator[tuple[SagittalModel, Launch, Array]]:
    """The plans of a branch, from low to high."""
    model = SagittalModel(robot, branch.launch.shoulder_roll)
    program = LaunchProgram(model, branch.launch)
    landing = LandingProgram(model, margins.landing)
    found = [program.highest(crouch, takeoff) for crouch, takeoff in branch.starts]
    highest = max((launch for launch in found if launch.feasible), key=_rise, default=None)
    if highest is None:
        raise PlanningError(f"no launch of {robot.name} keeps the limits")
    launches = [highest] if highest.rise <= branch.highest else []
    near, top = highest, min(highest.rise, branch.highest + margins.step)
    # Each search starts at the plan above, so that the family is smooth.
    for height in _heights(branch.lowest, top, margins.step):
        near = program.to_height(height, near, highest.q[0])
        if not near.feasible:
            raise PlanningError(f"no launch of {robot.name} to {100 * height:.1f} cm was found")
        launches.append(near)
    for launch in reversed(launches):
        yield model, launch, landing.solve(launch)


def _rise(launch: Launch) -> float:
    return launch.rise


def _heights(lowest: float, highest: float, step: float) -> Iterator[float]:
    """Multiples of the step between two heights, from high to low, and the lowest."""
    for k in itertools.count(int(highest / step), -1):
        height = k * step
        if height <= lowest + step / 4:
            yield lowest
            return
        if height < highest - step / 4:
            yield height
