"""The posture of flight and landing: soles level when they touch the floor."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import PlanningError
from icub_jump_env.planning.minimum_jerk import PEAK_SPEED, progress
from icub_jump_env.planning.whole_body.launch import Launch
from icub_jump_env.planning.whole_body.margins import LandingMargins
from icub_jump_env.planning.whole_body.sagittal import (
    ANKLE,
    COORDINATES,
    ELBOW,
    HIP,
    SHOULDER,
    TORSO,
    SagittalModel,
    chest_pitch,
    coordinates,
)
from icub_jump_env.robot.icub import GRAVITY

Array = NDArray[np.float64]

_SAMPLES = 30
"""Samples of the flight, over which the rotation is summed up."""


class LandingProgram:
    """Chooses the posture at touch-down of a launch.

    In the air the angular momentum is constant, so what the joints do turns the robot. The way
    from the posture at take-off shall leave the soles level at touch-down, with the CoM above
    their middle.

    Attributes:
        model: The robot in its sagittal plane.
        margins: Where the posture may be.
    """

    def __init__(self, model: SagittalModel, margins: LandingMargins) -> None:
        """Pose the program.

        Args:
            model: The robot in its sagittal plane.
            margins: Where the posture may be.
        """
        self.model, self.margins = model, margins
        n, robot = len(COORDINATES), model.robot
        opti = self._opti = ca.Opti()
        self._posture = opti.variable(n)
        self._start, self._preferred = opti.parameter(n), opti.parameter(n)
        self._momentum, self._height, self._speed = (opti.parameter() for _ in range(3))
        self._highest = opti.parameter()
        y, way = self._posture, self._posture - self._start

        rest = ca.DM.zeros(n)
        landed = self._at(model.dynamics(y, rest, rest))
        com = landed["com"]
        lower, upper = self._position_limits()
        fastest = margins.speed * coordinates(robot, robot.velocity_limit) * margins.retraction
        opti.subject_to(opti.bounded(lower, y, upper))
        opti.subject_to(opti.bounded(-1, PEAK_SPEED * way / fastest, 1))
        opti.subject_to(com[0] == robot.sole.center_x + margins.com_forward)
        opti.subject_to(opti.bounded(self._highest - margins.com_range, com[1], self._highest))
        opti.subject_to(opti.bounded(margins.chest[0], chest_pitch(y), margins.chest[1]))
        pitch = self._sole_pitch(way, landed)
        opti.minimize(
            ca.dot(ca.DM(margins.posture_cost), (y - self._preferred) ** 2)
            + margins.level_cost * pitch**2
        )
        opti.solver(
            "ipopt", {"expand": True, "print_time": False}, {"print_level": 0, "sb": "yes"}
        )

    def _at(self, outputs: Any) -> dict[str, Any]:
        return dict(zip(self.model.dynamics.name_out(), outputs, strict=True))

    def _position_limits(self) -> tuple[Array, Array]:
        margins, robot = self.margins, self.model.robot
        lower = coordinates(robot, robot.lower_position) + margins.position
        upper = coordinates(robot, robot.upper_position) - margins.position
        lower[ANKLE] = max(lower[ANKLE], margins.ankle)
        upper[HIP] = min(upper[HIP], margins.hip)
        lower[TORSO] = max(lower[TORSO], margins.torso[0])
        upper[TORSO] = min(upper[TORSO], margins.torso[1])
        lower[SHOULDER] = max(lower[SHOULDER], margins.shoulder)
        upper[ELBOW] = min(upper[ELBOW], margins.elbow)
        return lower, upper

    def _sole_pitch(self, way: Any, landed: dict[str, Any]) -> Any:
        """Pitch of the soles at touch-down (rad)."""
        retraction = self.margins.retraction
        speed, drop = self._speed, self._height - landed["com"][1]
        flight = (speed + ca.sqrt(ca.fmax(speed**2 + 2 * GRAVITY * drop, 1e-6))) / GRAVITY
        done, rate = progress((np.arange(_SAMPLES) + 0.5) / _SAMPLES)
        n = len(COORDINATES)
        along = self._at(
            self.model.dynamics.map(_SAMPLES)(
                self._start + way @ ca.DM(done).T, way @ ca.DM(rate).T, ca.DM.zeros(n, _SAMPLES)
            )
        )
        # With the soles at rest the motion would have a momentum; they turn by what is missing.
        lag = (retraction * self._momentum - along["momentum"]) / along["inertia"]
        after = self._momentum / landed["inertia"] * (flight - retraction)
        return ca.sum2(lag) / _SAMPLES + after

    def solve(self, launch: Launch) -> Array:
        """The coordinates (6,) at touch-down (rad).

        Raises:
            PlanningError: If there are none within the margins.
        """
        opti, margins = self._opti, self.margins
        takeoff = {name: values[-1] for name, values in launch.outputs.items()}
        preferred = np.array(margins.posture)
        arms = slice(SHOULDER, ELBOW + 1)
        preferred[arms] = (preferred[arms] + launch.q[-1, arms]) / 2
        opti.set_value(self._start, launch.q[-1])
        opti.set_value(self._momentum, takeoff["momentum"])
        opti.set_value(self._height, takeoff["com"][1])
        opti.set_value(self._speed, takeoff["com_velocity"][1])
        opti.set_value(self._highest, min(margins.com_height, takeoff["com"][1] - 0.01))
        opti.set_value(self._preferred, preferred)
        opti.set_initial(self._posture, preferred)
        try:
            found: Array = np.array(opti.solve().value(self._posture))
        except RuntimeError as error:
            raise PlanningError(f"no landing posture after {100 * launch.rise:.1f} cm") from error
        return found
