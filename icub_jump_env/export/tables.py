"""Plans and jumps as CSV, a column for each number, SI units."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import FileError
from icub_jump_env.files import write_file
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
    """A plan: its set point at the control ticks from the start on, and at take-off.

    The CoM is that from where it is when the jump begins.

    Args:
        plan: The plan.
        robot: Whose joints the columns are named after.
        frequency: Rows per second (Hz).
        path: The file.

    Raises:
        OSError: If the file system refuses.
    """
    ticks = math.ceil(plan.duration * frequency - 1e-9)
    times = [*(tick / frequency for tick in range(ticks)), plan.duration]
    names = list(Setpoint.__annotations__)

    def row(time: float) -> dict[str, Cell]:
        setpoint = plan.sample(time)
        return {"time": time} | _flat({name: getattr(setpoint, name) for name in names}, robot)

    _write(map(row, times), path)


def read_table(path: Path) -> dict[str, list[Cell]]:
    """The columns of a file by name; numbers where all are.

    Raises:
        FileError: If rows are of different lengths.
        OSError: If the file cannot be read.
    """
    with path.open(newline="") as file:
        names, *rows = csv.reader(file) or [[]]
    if any(len(row) != len(names) for row in rows):
        raise FileError(str(path), "rows of different lengths")
    columns: dict[str, list[Cell]] = {}
    for name, words in zip(names, zip(*rows, strict=True), strict=False):
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
    rows, text = list(rows), io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    write_file(path, text.getvalue().encode())
