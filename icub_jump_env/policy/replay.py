"""A table of actions as policy: open loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_count, check_number, check_type, store
from icub_jump_env.config import AGENT_FREQUENCY_RANGE
from icub_jump_env.errors import ConfigError
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.residual import COM_AXES, AxisName, check_axes
from icub_jump_env.policy.fields import PolicyKind, check_array

Array = NDArray[np.float32]

MAX_COMMANDS = 100
MAX_STEPS = 10_000
"""At 1000 Hz, the 10 s at which the time in the observation is clipped."""

_COMMAND_LIMIT = 1.0  # m
_TIME, _HEIGHT = DEFAULT.slices["time"].start, DEFAULT.slices["jump_height"].start
_TIME_SCALE, _HEIGHT_SCALE = DEFAULT.scales["time"], DEFAULT.scales["jump_height"]


@dataclass(frozen=True, eq=False)
class ReplayPolicy:
    """Plays actions back by the time; between two commands it interpolates linearly.

    Below the lowest and above the highest command it plays those of the nearest one;
    after the last step, the last action.

    Attributes:
        commands: (C,) commanded rise in flight (m), ascending, float32.
        actions: (C, S, axes) action of each command and step, in [-1, 1], float32.
        agent_frequency: Steps per second (Hz).
        axes: All axes of the action.

    Raises:
        ConfigError: If the arrays are misshapen, or a value is out of range.
    """

    kind: ClassVar[PolicyKind] = "replay"
    inputs: ClassVar[tuple[str, ...]] = ("time", "jump_height")
    hidden: ClassVar[tuple[int, ...]] = ()
    action_scale: ClassVar[float] = 1.0

    commands: Array = field(repr=False)
    actions: Array = field(repr=False)
    agent_frequency: float
    axes: tuple[AxisName, ...] = COM_AXES

    def __post_init__(self) -> None:
        check_type("commands", self.commands, np.ndarray)
        check_type("actions", self.actions, np.ndarray)
        n_commands = check_count("number of commands", self.commands.size, 1, MAX_COMMANDS)
        n_axes = len(check_axes(self.axes))
        n_steps = check_count(
            "number of steps", self.actions.size // (n_axes * n_commands), 1, MAX_STEPS
        )
        commands = check_array("commands", self.commands, (n_commands,), _COMMAND_LIMIT)
        if not (np.diff(commands) > 0.0).all():
            raise ConfigError("commands", commands.tolist(), "ascending heights (m)")
        store(
            self,
            commands=commands,
            actions=check_array("actions", self.actions, (n_commands, n_steps, n_axes), 1.0),
            agent_frequency=check_number(
                "agent_frequency", self.agent_frequency, *AGENT_FREQUENCY_RANGE, "Hz"
            ),
        )

    def __call__(self, observation: Array) -> Array:
        """The action for an observation, each as the environment has them."""
        n_commands, n_steps, _ = self.actions.shape
        step = round(float(observation[_TIME]) * _TIME_SCALE * self.agent_frequency)
        step = min(max(step, 0), n_steps - 1)
        command = float(observation[_HEIGHT]) * _HEIGHT_SCALE
        # Rounded, so that a command of the table gets its own actions to the bit, and that
        # no rounding below leads beyond the upper ones.
        place = round(float(np.interp(command, self.commands, np.arange(n_commands))), 4)
        low = int(place)
        lower = self.actions[low, step]
        upper = self.actions[min(low + 1, n_commands - 1), step]
        action: Array = lower + np.float32(place - low) * (upper - lower)
        return action

    def tensors(self) -> dict[str, Array]:
        """The arrays by the name that they have on disk."""
        return {"commands": self.commands, "actions": self.actions}
