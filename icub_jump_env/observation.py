"""Layout of the observation: what each of its entries means.

The observation holds what the robot can know: sensor readings, estimates made of them,
the command and the phase. ``python -m icub_jump_env.observation`` prints the table of
docs/environment.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot.icub import JOINT_NAMES

OBSERVATION_LIMIT = 10.0
"""Entries are clipped to plus or minus this, after scaling."""

_XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Block:
    """Neighbouring entries of one meaning.

    Attributes:
        name: Name of the block.
        labels: Name of each entry in it.
        meaning: What it is.
        unit: Unit before scaling.
        frame: Reference frame, if any.
        scale: The entries are divided by this.
    """

    name: str
    labels: tuple[str, ...]
    meaning: str
    unit: str
    frame: str
    scale: float


BLOCKS: tuple[Block, ...] = (
    Block("phase", ("launch", "flight", "landing"), "current phase, one-hot", "-", "-", 1.0),
    Block(
        "launch_progress",
        ("",),
        "time since the start of the jump / take-off time T, at most 1",
        "-",
        "-",
        1.0,
    ),
    Block("time", ("",), "time since the start of the jump", "s", "-", 1.0),
    Block("jump_height", ("",), "commanded rise in flight", "m", "-", 0.05),
    Block("com_displacement", ("",), "planned CoM rise in the launch", "m", "-", 0.1),
    Block("takeoff_time", ("",), "planned take-off time T", "s", "-", 0.5),
    Block("joint_position", JOINT_NAMES, "encoder minus crouch posture", "rad", "joint", 1.0),
    Block("joint_velocity", JOINT_NAMES, "encoder velocity", "rad/s", "joint", 5.0),
    Block("gravity", _XYZ, "direction of gravity (IMU)", "-", "base, x forward", 1.0),
    Block("gyro", _XYZ, "angular velocity of the base (IMU)", "rad/s", "base, x forward", 2.0),
    Block(
        "com_offset", _XYZ, "estimated CoM minus CoM at the start of the jump", "m", "world", 0.1
    ),
    Block("com_velocity", _XYZ, "estimated CoM velocity", "m/s", "world", 1.0),
    Block(
        "angular_momentum", _XYZ, "estimated centroidal angular momentum", "kg m^2/s", "world", 1.0
    ),
    Block(
        "com_error",
        _XYZ,
        "estimated CoM minus CoM reference; 0 after the launch",
        "m",
        "world",
        0.02,
    ),
    Block("residual_offset", _XYZ, "shaped residual on the CoM reference", "m", "world", 0.05),
    Block("residual_velocity", _XYZ, "its derivative", "m/s", "world", 0.5),
    Block("foot_force", ("left", "right"), "normal force under each sole", "N", "world z", 300.0),
)


def _slices() -> dict[str, slice]:
    slices, start = {}, 0
    for block in BLOCKS:
        slices[block.name] = slice(start, start + len(block.labels))
        start += len(block.labels)
    return slices


SLICES = _slices()
"""Slice of each block in the observation."""

SIZE = sum(len(block.labels) for block in BLOCKS)

_SCALE = np.concatenate([np.full(len(block.labels), block.scale) for block in BLOCKS])


def encode(values: Mapping[str, NDArray[np.float64] | float]) -> NDArray[np.float32]:
    """Assemble, scale and clip an observation.

    Args:
        values: The value of each block by name, in SI units.

    Returns:
        (SIZE,) entries of the observation space.
    """
    raw = np.empty(SIZE)
    for block in BLOCKS:
        raw[SLICES[block.name]] = values[block.name]
    scaled: NDArray[np.float64] = np.clip(raw / _SCALE, -OBSERVATION_LIMIT, OBSERVATION_LIMIT)
    return scaled.astype(np.float32)


def entry_scales() -> dict[str, float]:
    """By what each entry is divided; entries by name, in the order of the observation."""
    return {
        f"{block.name}.{label}" if label else block.name: block.scale
        for block in BLOCKS
        for label in block.labels
    }


def layout_table() -> str:
    """The layout as a Markdown table, one row per entry."""
    rows = ["| index | entry | meaning | unit | frame | divided by |", "|---|---|---|---|---|---|"]
    entries = list(entry_scales())
    for block in BLOCKS:
        for index in range(SLICES[block.name].start, SLICES[block.name].stop):
            rows.append(
                f"| {index} | `{entries[index]}` | {block.meaning} "
                f"| {block.unit} | {block.frame} | {block.scale:g} |"
            )
    return "\n".join(rows)


if __name__ == "__main__":
    print(layout_table())
