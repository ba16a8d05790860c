"""How far the believed state is from the true one, phase by phase.

    python -m experiments.estimators --episodes 30

Each estimator takes in the readings of the same jumps: the paper's (``feet_fixed``), ``imu``,
``imu`` without accelerometer, and ``imu`` without the direction of gravity in the air. The jumps
are controlled as in the paper, and with feedback in flight and landing.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TUNING
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.estimation.estimator import Estimator
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.imu import CONTACT_GAIN, ImuEstimator, load_of, share_of
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, seeds
from icub_jump_env.evaluation.report.output import (
    check_writable,
    new_table,
    progress_display,
    say,
    show,
    write_json,
)
from icub_jump_env.records import Block
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.mujoco_model import sole_geom
from icub_jump_env.simulation.randomization import RandomizationName
from icub_jump_env.simulation.sensor_models import SensorName

Array = NDArray[np.float64]

Control = Literal["paper", "feedback"]
"""Of flight and landing: as in the paper, or with feedback of the estimated state."""

CONTROLS: dict[Control, dict[str, str]] = {
    "paper": {},
    "feedback": {"estimator": "imu", "flight": "feedback", "landing": "feedback"},
}
WORLDS: tuple[tuple[RandomizationName, SensorName], ...] = (
    ("full", "ideal"),
    ("hard", "ideal"),
    ("full", "realistic"),
)
PHASES = ("launch", "last 30 ms", "flight", "landing", "after")
LAST, LANDING = 0.03, 0.3
"""Before take-off the launch's last part, after touch-down the landing (s)."""

QUANTITIES = (
    ("attitude", "deg", 2),
    ("angular momentum", "kg m^2/s", 2),
    ("CoM from soles", "cm", 2),
    ("CoM velocity", "m/s", 3),
)
"""Name, unit and decimals of what errors are computed of."""
ATTITUDE, VELOCITY = 0, 3
"""Which of them; the accelerometer has a part in the last one alone."""

COMPARED = {ATTITUDE: ["inertial in the air"], VELOCITY: ["without accelerometer"]}
"""What else the tables have, by quantity."""

ATTITUDE_AIM, VELOCITY_AIM = 0.3, 0.04
"""Largest errors (deg, m/s) aimed at in flight under ``full``."""


@dataclass(frozen=True)
class EstimatorOptions:
    """Compare the estimators with the truth.

    Attributes:
        episodes: Of each row; no controller or gain was chosen on their seeds.
        json: Write all errors to this file.
    """

    episodes: int = 30
    json: Path | None = None

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1)


class Motion(NamedTuple):
    """What is true, or believed, at one instant; world frame.

    Attributes:
        rotation: (3, 3) orientation of the base.
        angular_momentum: (3,) about the CoM (kg m^2/s).
        com: (3,) m.
        com_velocity: (3,) m/s.
        soles: (2, 3) middles of the undersides (m).
    """

    rotation: Array
    angular_momentum: Array
    com: Array
    com_velocity: Array
    soles: Array

    @classmethod
    def believed(cls, state: RobotState) -> Motion:
        """What an estimator says; views."""
        R, momentum = state.base_rotation, state.angular_momentum
        return cls(R, momentum, state.com, state.com_velocity, state.sole_position)

    def errors(self, truth: Motion) -> list[float]:
        """Of the :data:`QUANTITIES`, in their units."""
        offset = self.com - self.soles.mean(axis=0) - truth.com + truth.soles.mean(axis=0)
        up, true_up = self.rotation[2], truth.rotation[2]
        return [
            math.degrees(math.atan2(float(np.linalg.norm(np.cross(up, true_up))), up @ true_up)),
            float(np.linalg.norm(self.angular_momentum - truth.angular_momentum)),
            CM * float(np.linalg.norm(offset)),
            float(np.linalg.norm(self.com_velocity - truth.com_velocity)),
        ]


class Truth:
    """The present motion; the simulation itself keeps that of the last step's beginning."""

    def __init__(self, model: Any) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._base = model.body("root_link").id
        self._soles = [model.geom(sole_geom(side)).id for side in "lr"]

    def read(self, data: Any) -> Motion:
        """Of the MuJoCo data of an episode; copies."""
        model, own = self._model, self._data
        own.qpos[:], own.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(model, own)
        down = [
            model.geom_size[sole][2] * own.geom_xmat[sole].reshape(3, 3)[:, 2]
            for sole in self._soles
        ]
        return Motion(
            own.xmat[self._base].reshape(3, 3).copy(),
            own.sensor("angular_momentum").data.copy(),
            own.sensor("com").data.copy(),
            own.sensor("com_velocity").data.copy(),
            own.geom_xpos[self._soles] - down,
        )


class WithoutAccelerometer(ImuEstimator):
    """Believes the velocity of the feet as far as they carry load, else that the CoM falls."""

    def _predict(self, *blocks: Block) -> None:
        memory, kinematics, state = self._memory, self._kinematics, self._state
        first = memory.readings == 0.0
        position, before = memory.base_position.copy(), memory.base_velocity.copy()
        super()._predict(*blocks)
        if first:
            return
        relative = kinematics.A_base[:3, 3:] @ memory.base_twist[3:]
        relative += kinematics.A_joints[:3] @ state.joint_velocity
        falling = state.com_velocity + (GRAVITY * memory.dt) * state.gravity
        memory.base_velocity[:] = falling - state.base_rotation @ relative / kinematics.mass
        memory.base_position[:] = position + memory.dt / 2 * (before + memory.base_velocity)

    def _stand(self, *blocks: Block) -> None:
        memory = self._memory
        before = memory.base_velocity.copy()
        super()._stand(*blocks)
        load = load_of(memory.block[0], float(self._state.foot_force.sum()), 1.0)
        if load > 0.0:
            # Nothing to wait for: the correction comes whole.
            taken = share_of(memory.block[0], CONTACT_GAIN * load)
            memory.base_velocity[:] = before + load / taken * (memory.base_velocity - before)


class InertialInTheAir(ImuEstimator):
    """Takes no reading of gravity in the air, where a real IMU has none either."""

    def _correct_attitude(self, *blocks: Block) -> None:
        if self._memory.airborne:
            kinematics, readings, *others = blocks
            readings = readings.copy()
            down = self._state.base_rotation.T @ self._state.gravity
            readings["gravity"][0] = self._memory.base_R_imu.T @ down
            blocks = kinematics, readings, *others
        super()._correct_attitude(*blocks)


ESTIMATORS: dict[str, Callable[[FeetFixedKinematics, float], Estimator]] = {
    "feet_fixed": lambda kinematics, dt: FeetFixedEstimator(kinematics),
    "imu": ImuEstimator,
    "without accelerometer": WithoutAccelerometer,
    "inertial in the air": InertialInTheAir,
}


class WatchedEnv(ICubJumpEnv):
    """A jump that tells of every control tick.

    Attributes:
        watch: Called with the readings of each.
    """

    watch: Callable[[Readings], None]

    def _sense(self) -> None:
        super()._sense()
        self.watch(self._simulation.sensors.readings)


class Comparison:
    """All estimators beside each other in the jumps of one configuration."""

    def __init__(self, config: JumpConfig) -> None:
        self._env = WatchedEnv(**vars(config))
        self._env.watch = self._look
        self._truth = Truth(self._env.model)
        self._estimators = [
            make(FeetFixedKinematics(config.robot_value), config.control_dt)
            for make in ESTIMATORS.values()
        ]
        self._times: list[float] = []
        self._errors: list[list[list[float]]] = []

    def _look(self, readings: Readings) -> None:
        truth = self._truth.read(self._env.data)
        self._times.append(self._env.data.time)
        self._errors.append(
            [
                Motion.believed(estimator.estimate(readings)).errors(truth)
                for estimator in self._estimators
            ]
        )

    def jump(self, seed: int) -> Array:
        """(phases, estimators, quantities) root-mean-square errors; NaN of a phase not reached."""
        for estimator in self._estimators:
            estimator.reset()
        self._times.clear()
        self._errors.clear()
        self._env.reset(seed=seed)
        terminated = False
        while not terminated:
            _, _, terminated, _, info = self._env.step(np.zeros(3, np.float32))
        jump = info["jump"]
        phases = phases_of(np.array(self._times), jump["takeoff_time"], jump["flight_time"])
        squares = np.array(self._errors) ** 2
        return np.array(
            [
                np.sqrt(squares[phases == k].mean(axis=0))
                if (phases == k).any()
                else np.full(squares.shape[1:], math.nan)
                for k in range(len(PHASES))
            ]
        )


def phases_of(times: Array, takeoff: float, flight: float) -> NDArray[np.int64]:
    """Which of the :data:`PHASES` each time (s) is in.

    Args:
        times: (k,) since the start.
        takeoff: When contact was lost; NaN if it never was.
        flight: How long the flight was; 0 if the robot never came down.
    """
    touchdown = takeoff + flight if flight > 0.0 else math.inf
    begins = [takeoff - LAST, takeoff, touchdown, touchdown + LANDING]
    # A time is not beyond NaN.
    return sum(
        (np.asarray(times >= begin, np.int64) for begin in begins), np.zeros(len(times), int)
    )


@dataclass(frozen=True)
class Row:
    """One kind of jump.

    Attributes:
        control: Of flight and landing.
        controller: Of the launch.
        randomization: The worlds.
        sensors: The sensors.
        errors: (episodes, phases, estimators, quantities) root-mean-square errors of each jump.
    """

    control: Control
    controller: ControllerName
    randomization: RandomizationName
    sensors: SensorName
    errors: Array

    def median(self, phase: str, estimator: str, quantity: int) -> float:
        """Over the jumps that reached the phase."""
        found = self.errors[:, PHASES.index(phase), list(ESTIMATORS).index(estimator), quantity]
        reached = found[~np.isnan(found)]
        return float(np.median(reached)) if reached.size else math.nan

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return vars(self) | {"errors": self.errors.tolist()}


def run(options: EstimatorOptions) -> None:
    """Jump, compare, print."""
    console = Console()
    if options.json is not None:
        check_writable("json", options.json)
    used = range(TUNING.stop, TUNING.stop + options.episodes)
    rows = []
    cases = list(itertools.product(get_args(Control), CONTROLLERS, WORLDS))
    with progress_display(Console(stderr=True), *[]) as progress:
        for control, controller, (randomization, sensors) in progress.track(cases):
            config = JumpConfig.of(
                controller=controller,
                randomization=randomization,
                sensors=sensors,
                **CONTROLS[control],
            )
            comparison = Comparison(config)
            errors = np.array([comparison.jump(seed) for seed in used])
            rows.append(Row(control, controller, randomization, sensors, errors))
    for line in conclusions(rows):
        say(console, line)
    for control in get_args(Control):
        those = [row for row in rows if row.control == control]
        show(console, render(those, f"Control: {control}; {seeds(used)}"))
    if options.json is not None:
        names = {
            "phases": PHASES,
            "estimators": list(ESTIMATORS),
            "quantities": [f"{name}, {unit}" for name, unit, _ in QUANTITIES],
        }
        content = {"seeds": list(used), **names, "rows": [row.as_dict() for row in rows]}
        write_json(options.json, content)


def conclusions(rows: Sequence[Row]) -> list[str]:
    """What the tables say, in one line each: the worst of the rows concerned."""

    def worst(world: tuple[str, str], phase: str, estimator: str, quantity: int) -> float:
        return max(
            row.median(phase, estimator, quantity)
            for row in rows
            if (row.randomization, row.sensors) == world
        )

    ideal, hard, realistic = WORLDS
    attitude = worst(ideal, "flight", "imu", ATTITUDE)
    velocity = worst(ideal, "flight", "imu", VELOCITY)
    believed, without, inertial = "imu", "without accelerometer", "inertial in the air"
    return [
        f"attitude in flight under full: {attitude:.2f} deg, "
        f"{_verdict(attitude, ATTITUDE_AIM)} the aim of {ATTITUDE_AIM:g}; with realistic sensors "
        f"{worst(realistic, 'flight', believed, ATTITUDE):.2f}, feet_fixed "
        f"{worst(ideal, 'flight', 'feet_fixed', ATTITUDE):.1f}",
        f"CoM velocity in flight under full: {velocity:.3f} m/s, "
        f"{_verdict(velocity, VELOCITY_AIM)} the aim of {VELOCITY_AIM:g}; with realistic sensors "
        f"{worst(realistic, 'flight', believed, VELOCITY):.3f}, feet_fixed "
        f"{worst(ideal, 'flight', 'feet_fixed', VELOCITY):.2f}",
        *(
            f"without accelerometer, {phase}: CoM velocity "
            f"{worst(ideal, phase, without, VELOCITY):.3f} m/s instead of "
            f"{worst(ideal, phase, believed, VELOCITY):.3f}; with realistic sensors "
            f"{worst(realistic, phase, without, VELOCITY):.3f} instead of "
            f"{worst(realistic, phase, believed, VELOCITY):.3f}"
            for phase in ("flight", "landing")
        ),
        "without reading of gravity in the air: attitude in flight "
        f"{worst(ideal, 'flight', inertial, ATTITUDE):.2f} deg, with realistic sensors "
        f"{worst(realistic, 'flight', inertial, ATTITUDE):.2f}",
        f"attitude after the landing under hard: {worst(hard, 'after', believed, ATTITUDE):.2f} deg, "
        f"feet_fixed {worst(hard, 'after', 'feet_fixed', ATTITUDE):.2f}",
    ]


def _verdict(error: float, aim: float) -> str:
    return "within" if error <= aim else "beyond"


def render(rows: Sequence[Row], title: str) -> Table:
    """The errors of all estimators."""
    table = new_table(3, "error", "controller", "worlds", *PHASES, title=title)
    for quantity, (name, unit, decimals) in enumerate(QUANTITIES):
        known = ["feet_fixed", "imu", *COMPARED.get(quantity, [])]
        for row in rows:
            cells = (
                " ".join(f"{row.median(phase, e, quantity):.{decimals}f}" for e in known)
                for phase in PHASES
            )
            table.add_row(
                f"{name}, {unit}" if row is rows[0] else "",
                row.controller,
                f"{row.randomization}, {row.sensors}",
                *cells,
                end_section=row is rows[-1],
            )
    table.caption = (
        "root mean squares, medians over the jumps: feet_fixed, imu, and imu without gravity reading "
        "in the air (attitude) or without accelerometer (CoM velocity);\n"
        f"launch: until the last 30 ms; landing: the first {LANDING:g} s; "
        "attitude: but for turns about the vertical"
    )
    return table


if __name__ == "__main__":
    guarded(lambda: run(parse(EstimatorOptions, sys.argv[1:])))
