"""What binds in a launch, and when."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.planning.whole_body.launch import Launch, largest_speeds, largest_torques
from icub_jump_env.planning.whole_body.margins import LaunchMargins
from icub_jump_env.planning.whole_body.sagittal import COORDINATES, SagittalModel

_BINDS = 0.995
"""Share of a limit from which on it binds."""

_AT_EDGE = 1e-3
"""Distance of the CoP to its limit (m) within which it binds."""


def binding(
    model: SagittalModel, launch: Launch, margins: LaunchMargins
) -> dict[str, tuple[float, float]]:
    """What is at its limit somewhere along a launch, in words.

    Returns:
        First and last time (s) at which it is, by limit.
    """
    times = np.linspace(0.0, launch.duration, len(launch.q)).round(3)
    return {
        name: (float(times[at_limit][0]), float(times[at_limit][-1]))
        for name, at_limit in _limits(model, launch, margins)
        if at_limit.any()
    }


def _limits(
    model: SagittalModel, launch: Launch, margins: LaunchMargins
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Each limit, and at which knots it is reached."""
    robot, sole = model.robot, model.robot.sole
    for quantity, values, limits in (
        ("speed", launch.v, largest_speeds(robot, margins)),
        ("torque", launch.outputs["torque"], largest_torques(robot, margins)),
    ):
        for j, name in enumerate(COORDINATES):
            yield f"{name.replace('_', ' ')} {quantity}", np.abs(values[:, j]) > _BINDS * limits[j]
    forward, up = launch.outputs["force"].T
    cop = -launch.outputs["moment"][:, 0] / up
    yield "centre of pressure at the heels", cop < sole.x_min + margins.cop + _AT_EDGE
    yield "centre of pressure at the toes", cop > sole.x_max - margins.cop - _AT_EDGE
    yield "friction", np.abs(forward) > _BINDS * margins.friction * up
