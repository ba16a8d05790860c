"""Plans and jumps as CSV, a column for each number, SI units."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.robot.robot import Robot
from icub_jump_env.snapshot import Snapshot

WORLD = ("x", "y", "z")
Cell = float | str


def write_jump(snapshots: Sequence[Snapshot], robot: Robot, path: Path) -> None:
    """A jump: a row for each snapshot, whose fields are the columns.

    Args:
        snapshots: The jump, ``trace`` of an episode.
        robot: Whose joints the columns are named after.
        path: The file.

    Raises:
        OSError: If the file system refuses.
    """
    fields = [field.name for field in dataclasses.fields(Snapshot)]
    _write((_flat({name: getattr(s, name) for name in fields}, robot) for s in snapshots), path)


def write_plan(plan: JumpPlan, robot: Robot, frequency: float, path: Path) -> None:
    """A plan: its set point at the control ticks from the start to take-off.

    The CoM is that from where it is when the jump begins.

    Args:
        plan: The plan.
        robot: Whose joints the columns are named after.
        frequency: Rows per second (Hz).
        path: The file.

    Raises:
        OSError: If the file system refuses.
    """
    times = np.append(np.arange(0.0, plan.duration, 1.0 / frequency), plan.duration)
    names = list(Setpoint.__annotations__)

    def row(time: float) -> dict[str, Cell]:
        setpoint = plan.sample(time)
        return {"time": time} | _flat({name: getattr(setpoint, name) for name in names}, robot)

    _write((row(float(time)) for time in times), path)


def read_table(path: Path) -> dict[str, list[Cell]]:
    """The columns of a file by name; numbers where all are.

    Raises:
        OSError: If the file cannot be read.
    """
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns: dict[str, list[Cell]] = {}
    for name in rows[0] if rows else ():
        words = [row[name] for row in rows]
        try:
            columns[name] = [float(word) for word in words]
        except ValueError:
            columns[name] = list(words)
    return columns


def _flat(values: Mapping[str, Cell | NDArray[np.float64]], robot: Robot) -> dict[str, Cell]:
    """Vectors in world axes become three entries, those of the joints one for each."""
    flat: dict[str, Cell] = {}
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            parts = WORLD if len(value) == len(WORLD) else robot.joint_names
            flat |= {f"{name}.{p}": v for p, v in zip(parts, value.tolist(), strict=True)}
        else:
            flat[name] = value
    return flat


def _write(rows: Iterable[Mapping[str, Cell]], path: Path) -> None:
    rows = list(rows)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
