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
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.estimation_errors import (
    ATTITUDE,
    ESTIMATORS,
    LANDING,
    PHASES,
    QUANTITIES,
    VELOCITY,
    Comparison,
)
from experiments.seeds import TUNING
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.quantities import CONTROLLERS, seeds
from icub_jump_env.evaluation.report.output import (
    check_writable,
    new_table,
    progress_display,
    say,
    show,
    write_json,
)
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
