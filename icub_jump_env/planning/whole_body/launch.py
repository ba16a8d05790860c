"""The optimal control problem of the launch: from rest in a crouch to take-off.

Direct collocation in six coordinates: accelerations are linear between the knots, so that
positions are cubic, and all limits hold at the knots.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.planning.whole_body.margins import LaunchMargins
from icub_jump_env.planning.whole_body.sagittal import (
    ANKLE,
    COORDINATES,
    HIP,
    SHOULDER,
    TORSO,
    SagittalModel,
    chest_pitch,
    coordinates,
    stopping_inertia,
)
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]

KNOTS = 25
"""Knots of a launch, 24 intervals of 20 ms."""

FEASIBLE = 1e-5
"""Largest violation of a constraint (in the program's units) of a launch that is used."""

_ACCELERATION = 100.0
"""Unit of the accelerations in the program (rad/s^2): variables of order one."""

_IPOPT: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "max_iter": 300,
    "tol": 1e-6,
    "acceptable_tol": 1e-4,
    "acceptable_iter": 10,
    "acceptable_constr_viol_tol": 1e-6,
    "mu_strategy": "adaptive",
}


@dataclass(frozen=True)
class Launch:
    """A solution of the program; arrays by knot.

    Attributes:
        duration: T (s).
        q, v, a: (KNOTS, 6) coordinates and their rates (rad, rad/s, rad/s^2).
        outputs: Outputs of :attr:`SagittalModel.dynamics`, (KNOTS, size).
        rise: Ballistic rise after take-off (m).
        iterations: Of the solver.
        violation: Largest violation of a constraint, in the program's units.
    """

    duration: float
    q: Array
    v: Array
    a: Array
    outputs: dict[str, Array]
    rise: float
    iterations: int
    violation: float

    @property
    def feasible(self) -> bool:
        """Whether it keeps the limits."""
        return self.violation < FEASIBLE


def largest_speeds(robot: Robot, margins: Any) -> list[Any]:
    """Of the six coordinates (rad/s), by :class:`LaunchMargins` or their symbols."""
    shares = [margins.speed] * len(COORDINATES)
    shares[TORSO] = margins.torso_speed
    limits = coordinates(robot, robot.velocity_limit)
    return [share * limit for share, limit in zip(shares, limits, strict=True)]


def largest_torques(robot: Robot, margins: Any) -> list[Any]:
    """Of one motor of each coordinate (Nm), likewise."""
    return [margins.torque * limit for limit in coordinates(robot, robot.effort_limit)]


class LaunchProgram:
    """The program of one robot; margins, height and preferred crouch are its parameters.

    To pose it takes ten times as long as to solve it, so it serves all branches of a family.

    Attributes:
        model: The robot in its sagittal plane.
    """

    def __init__(self, model: SagittalModel, margins: LaunchMargins) -> None:
        """Pose the program.

        Args:
            model: The robot in its sagittal plane.
            margins: Limits and costs, until :meth:`keep` sets others.
        """
        self.model = model
        n = len(COORDINATES)
        opti = self._opti = ca.Opti()
        self._margins = SimpleNamespace(
            **{
                name: opti.parameter(np.size(value))
                for name, value in dataclasses.asdict(margins).items()
            }
        )
        self._Q, self._V, self._A = (opti.variable(n, KNOTS) for _ in range(3))
        self._T = opti.variable()
        self._crouch = opti.parameter(n)
        self._speeds = opti.parameter(2)
        self._rise_weight = opti.parameter()
        results = model.dynamics.map(KNOTS)(self._Q, self._V, self._A * _ACCELERATION)
        self._at = dict(zip(model.dynamics.name_out(), results, strict=True))
        self._speed = ca.vertcat(*largest_speeds(model.robot, self._margins))
        self._torque = ca.vertcat(*largest_torques(model.robot, self._margins))
        self._transcribe()
        self._limit_joints()
        self._limit_contact()
        self._limit_shape()
        takeoff = self._takeoff_speed = self._at["com_velocity"][1, -1]
        opti.subject_to(opti.bounded(self._speeds[0], takeoff, self._speeds[1]))
        rise = takeoff**2 / (2 * GRAVITY)
        opti.minimize(self._cost() - self._rise_weight * rise)
        opti.solver("ipopt", {"expand": True, "print_time": False}, _IPOPT)
        self.keep(margins)

    def keep(self, margins: LaunchMargins) -> None:
        """Search with these limits and costs from now on."""
        for name, value in dataclasses.asdict(margins).items():
            self._opti.set_value(getattr(self._margins, name), value)

    def _between(self, low: Any, value: Any, high: Any) -> None:
        self._opti.subject_to(self._opti.bounded(low, value, high))

    def _transcribe(self) -> None:
        opti, Q, V, A = self._opti, self._Q, self._V, self._A
        dt = self._T / (KNOTS - 1)
        now, after = A[:, :-1] * _ACCELERATION, A[:, 1:] * _ACCELERATION
        opti.subject_to(V[:, 1:] == V[:, :-1] + dt / 2 * (now + after))
        opti.subject_to(Q[:, 1:] == Q[:, :-1] + dt * V[:, :-1] + dt**2 * (now / 3 + after / 6))
        # At rest, also statically: the torques of the first knot hold the crouch.
        opti.subject_to(V[:, 0] == 0)
        opti.subject_to(A[:, 0] == 0)
        duration = self._margins.duration
        self._between(duration[0], self._T, duration[1])

    def _limit_joints(self) -> None:
        margins, robot = self._margins, self.model.robot
        lower_stop, upper_stop = (
            coordinates(robot, limit) for limit in (robot.lower_position, robot.upper_position)
        )
        lower = [stop + margins.position for stop in lower_stop]
        upper = [stop - margins.position for stop in upper_stop]
        lower[ANKLE] = ca.fmax(lower_stop[ANKLE], margins.ankle[0])
        upper[ANKLE] = ca.fmin(upper_stop[ANKLE], margins.ankle[1])
        upper[HIP] = ca.fmin(upper[HIP], margins.hip)
        lower[TORSO] = ca.fmax(lower[TORSO], margins.torso[0])
        upper[TORSO] = ca.fmin(upper[TORSO], margins.torso[1])
        lower[SHOULDER] = ca.fmax(lower[SHOULDER], margins.shoulder)
        # After take-off each joint must come to rest before its stop, at full torque.
        braking = coordinates(robot, robot.effort_limit) / stopping_inertia(robot)
        for j in range(len(COORDINATES)):
            self._between(lower[j], ca.vec(self._Q[j, :]), upper[j])
            self._between(-1, ca.vec(self._V[j, :]) / self._speed[j], 1)
            self._between(-1, ca.vec(self._at["torque"][j, :]) / self._torque[j], 1)
            v = self._V[j, -1]
            way = v * ca.sqrt(v**2 + 1e-4) / (2 * braking[j])
            end = self._Q[j, -1] + way
            self._between(lower_stop[j] + margins.stop, end, upper_stop[j] - margins.stop)

    def _limit_contact(self) -> None:
        opti, margins, sole = self._opti, self._margins, self.model.robot.sole
        forward, up = (ca.vec(self._at["force"][i, :]) for i in range(2))
        moment = ca.vec(self._at["moment"])
        weight = self.model.mass * GRAVITY
        opti.subject_to(up / weight >= margins.least_load)
        opti.subject_to((margins.friction * up - forward) / weight >= 0)
        opti.subject_to((margins.friction * up + forward) / weight >= 0)
        # The CoP on the floor is at -moment / up.
        heel, toe = sole.x_min + margins.cop, sole.x_max - margins.cop
        opti.subject_to((-moment - heel * up) / 10 >= 0)
        opti.subject_to((toe * up + moment) / 10 >= 0)

    def _limit_shape(self) -> None:
        opti, margins, sole = self._opti, self._margins, self.model.robot.sole
        com, velocity = self._at["com"], self._at["com_velocity"]
        chest = chest_pitch(self._Q).T
        self._between(margins.chest[0], chest, margins.chest[1])
        opti.subject_to(chest[-1] <= margins.takeoff_chest)
        edge = margins.crouch_com
        self._between(sole.x_min + edge, com[0, 0], sole.x_max - edge)
        opti.subject_to(com[1, 0] >= margins.crouch_height)
        opti.subject_to(com[1, -1] - com[1, 0] >= margins.displacement)
        opti.subject_to(velocity[0, -1] == margins.forward_speed)
        opti.subject_to(self._Q[HIP, -1] <= margins.takeoff_hip)
        momentum = margins.momentum
        self._between(momentum[0], self._at["momentum"][0, -1], momentum[1])

    def _cost(self) -> Any:
        margins = self._margins
        torque = self._at["torque"] / ca.repmat(self._torque, 1, KNOTS)
        speed = self._V / ca.repmat(self._speed, 1, KNOTS)
        jerk = (self._A[:, 1:] - self._A[:, :-1]) * (KNOTS - 1)
        return (
            margins.torque_cost * ca.sumsqr(torque) / KNOTS
            + margins.speed_cost * ca.sumsqr(speed) / KNOTS
            + margins.jerk_cost * ca.sumsqr(jerk) / KNOTS
            + margins.crouch_cost * ca.sumsqr(self._Q[:, 0] - self._crouch)
        )

    def highest(self, crouch: Sequence[float], takeoff: Sequence[float]) -> Launch:
        """The highest launch that a search from a straight way finds.

        Args:
            crouch: (6,) where the way begins (rad).
            takeoff: (6,) where it ends (rad).
        """
        opti = self._opti
        start, end = np.array(crouch)[:, None], np.array(takeoff)[:, None]
        T, u, way = 0.3, np.linspace(0.0, 1.0, KNOTS), end - start
        opti.set_initial(self._Q, start + way * u**2)
        opti.set_initial(self._V, 2 * way * u / T)
        opti.set_initial(self._A, np.repeat(2 * way / T**2 / _ACCELERATION, KNOTS, 1))
        opti.set_initial(self._T, T)
        # A metre of rise outweighs all costs.
        return self._solve((0.0, 10.0), 1000.0, np.array(crouch))

    def to_height(self, height: float, near: Launch, crouch: Array) -> Launch:
        """The launch to ``height`` (m) with a crouch near ``crouch`` ((6,) rad).

        Args:
            height: Ballistic rise (m).
            near: Where the search starts.
            crouch: The preferred crouch.
        """
        opti = self._opti
        opti.set_initial(self._Q, near.q.T)
        opti.set_initial(self._V, near.v.T)
        opti.set_initial(self._A, near.a.T / _ACCELERATION)
        opti.set_initial(self._T, near.duration)
        speed = math.sqrt(2 * GRAVITY * height)
        return self._solve((speed, speed), 0.0, crouch)

    def _solve(self, speeds: tuple[float, float], rise_weight: float, crouch: Array) -> Launch:
        opti = self._opti
        opti.set_value(self._speeds, speeds)
        opti.set_value(self._rise_weight, rise_weight)
        opti.set_value(self._crouch, crouch)
        found: Any
        try:
            found = opti.solve()
        except RuntimeError:  # not converged: what there is says how far
            found = opti.debug
        statistics = opti.stats()

        def value(expression: Any) -> Array:
            shape = expression.shape
            array: Array = np.array(found.value(expression)).reshape(shape).T
            return array

        return Launch(
            duration=float(found.value(self._T)),
            q=value(self._Q),
            v=value(self._V),
            a=value(self._A) * _ACCELERATION,
            outputs={name: value(expression) for name, expression in self._at.items()},
            rise=float(found.value(self._takeoff_speed)) ** 2 / (2 * GRAVITY),
            iterations=int(statistics["iter_count"]),
            violation=float(statistics["iterations"]["inf_pr"][-1]),
        )
