"""Layout of the observation: what each of its entries means.

The observation holds what the robot can know: sensor readings, estimates made of them,
the command and the phase. ``python -m icub_jump_env.observation`` prints the table of
docs/environment.md.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_count, check_flag, store
from icub_jump_env.planning.residual import AXES, COM_AXES, AxisName
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

    @property
    def entries(self) -> tuple[str, ...]:
        """The name of each of its entries."""
        return tuple(f"{self.name}.{label}" if label else self.name for label in self.labels)


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


HISTORY_BLOCKS = (
    "com_offset", "com_velocity", "angular_momentum", "gravity", "gyro", "foot_force",
    "residual_offset", "residual_momentum", "cop",
)  # fmt: skip
"""What is shown of earlier steps, too, as far as it is shown at all."""

MAX_HISTORY = 16
HISTORY_PERIOD = 0.01
"""Time between two of the steps that are remembered (s), or the longer one between two actions."""


@dataclass(frozen=True)
class ObservationConfig:
    """What the observation has beside :data:`BLOCKS`, behind them.

    Attributes:
        cop: Show the centre of pressure under each sole.
        contacts: Show which soles carry load.
        history: How many earlier steps, 10 ms apart, to show the CoM, momentum, IMU, feet and
            residual of.

    Raises:
        ConfigError: If a value is out of range.
    """

    cop: bool = False
    contacts: bool = False
    history: int = 0

    def __post_init__(self) -> None:
        for name in ("cop", "contacts"):
            store(self, **{name: check_flag(name, getattr(self, name))})
        store(self, history=check_count("history", self.history, 0, MAX_HISTORY, "steps"))


class Memory:
    """What is remembered of earlier steps of an episode."""

    def __init__(self, agent_frequency: float = 1.0 / HISTORY_PERIOD) -> None:
        """Remember nothing; steps come at ``agent_frequency`` (Hz)."""
        self._every = max(1, round(HISTORY_PERIOD * agent_frequency))
        self.forget()

    def forget(self) -> None:
        """An episode begins."""
        self._frames: deque[NDArray[np.float32]] = deque()
        self._shown = 0

    def recall(self, frame: NDArray[np.float32], history: int) -> tuple[NDArray[np.float32], ...]:
        """The earlier frames, the latest first; from now on ``frame`` may be one of them."""
        if not self._frames:
            self._frames.extend([frame] * history)
        frames = tuple(self._frames)
        if self._shown % self._every == 0:
            self._frames.pop()
            self._frames.appendleft(frame)
        self._shown += 1
        return frames


class Layout:
    """What each entry of an observation means.

    Attributes:
        blocks: Blocks in their order.
        slices: Slice of each block.
        size: Number of entries.
        scales: By what each entry is divided; entries by name, in their order.
    """

    def __init__(
        self, config: ObservationConfig | None = None, axes: Sequence[AxisName] = COM_AXES
    ) -> None:
        """Lay out the observation.

        Args:
            config: What it has beside :data:`BLOCKS`.
            axes: What actions move: the residual of the momentum is shown if they move that.
        """
        self._made_of = config, axes
        config = config or ObservationConfig()
        self._present = (*BLOCKS, *_more_blocks(config, axes))
        remembered = [block for block in self._present if block.name in HISTORY_BLOCKS]
        earlier = [
            replace(
                block,
                name=f"{block.name}@{steps}",
                meaning=f"{block.name}, {_steps(steps)} before",
            )
            for steps in range(1, config.history + 1)
            for block in remembered
        ]
        self.blocks = (*self._present, *earlier)
        self.slices: dict[str, slice] = {}
        self.size = 0
        for block in self.blocks:
            self.slices[block.name] = slice(self.size, self.size + len(block.labels))
            self.size += len(block.labels)
        self.scales: Mapping[str, float] = MappingProxyType(
            {name: block.scale for block in self.blocks for name in block.entries}
        )
        n_present = sum(len(block.labels) for block in self._present)
        self._divisors = np.array(list(self.scales.values())[:n_present])
        self._places = [(block.name, self.slices[block.name]) for block in self._present]
        places = np.arange(self.size)
        self._remembered = np.concatenate([places[self.slices[b.name]] for b in remembered])
        self._history = config.history

    def __reduce__(self) -> tuple[Any, ...]:
        return Layout, self._made_of

    def encode(
        self,
        values: Mapping[str, NDArray[np.float64] | float],
        memory: Memory,
    ) -> NDArray[np.float32]:
        """Assemble, scale and clip an observation.

        Args:
            values: The value of each block of the present by name, in SI units.
            memory: What is remembered of earlier steps; if it is empty, the present stands for
                them.

        Returns:
            (size,) entries of the observation space.
        """
        raw = np.empty(len(self._divisors))
        for name, place in self._places:
            raw[place] = values[name]
        raw /= self._divisors
        scaled = np.minimum(np.maximum(raw, -OBSERVATION_LIMIT), OBSERVATION_LIMIT)
        present: NDArray[np.float32] = scaled.astype(np.float32)
        if not self._history:
            return present
        frame = present[self._remembered]
        whole: NDArray[np.float32] = np.concatenate(
            (present, *memory.recall(frame, self._history))
        )
        return whole


def _steps(count: int) -> str:
    return "a step" if count == 1 else f"{count} steps"


def _more_blocks(config: ObservationConfig, axes: Sequence[AxisName]) -> Iterator[Block]:
    soles, unit = ("left.x", "left.y", "right.x", "right.y"), "kg m^2/s"
    if not set(axes) <= set(COM_AXES):
        yield Block(
            "residual_momentum", ("x", "y"), "shaped residual on the momentum", unit, "world", 1.0
        )
        yield Block("residual_torque", ("x", "y"), "its derivative", "Nm", "world", 10.0)
    if config.cop:
        meaning = "centre of pressure from the middle of the sole; 0 below 5 N"
        yield Block("cop", soles, meaning, "m", "sole, x forward", 0.05)
    if config.contacts:
        meaning = "whether the sole carries more than 5 N"
        yield Block("contact", ("left", "right"), meaning, "-", "-", 1.0)


DEFAULT = Layout()
"""That of the default configuration; others begin with it."""

SLICES, SIZE = DEFAULT.slices, DEFAULT.size


def layout_table(layout: Layout = DEFAULT) -> str:
    """The layout as a Markdown table, one row per entry."""
    rows = ["| index | entry | meaning | unit | frame | divided by |", "|---|---|---|---|---|---|"]
    entries = list(layout.scales)
    for block in layout.blocks:
        for index in range(layout.slices[block.name].start, layout.slices[block.name].stop):
            rows.append(
                f"| {index} | `{entries[index]}` | {block.meaning} "
                f"| {block.unit} | {block.frame} | {block.scale:g} |"
            )
    return "\n".join(rows)


if __name__ == "__main__":
    print(layout_table(Layout(ObservationConfig(cop=True, contacts=True, history=1), AXES)))
