"""A small neural network as policy, in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_count, check_number, store
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.residual import COM_AXES, AxisName, check_axes
from icub_jump_env.policy.fields import (
    ACTION_SCALE_RANGE,
    MAX_HIDDEN,
    PolicyKind,
    check_array,
    check_hidden,
    check_inputs,
)

Array = NDArray[np.float32]

WEIGHT_LIMIT = 1e6
"""Largest weight; far from where float32 overflows, so that actions are finite."""


@dataclass(frozen=True, eq=False)
class NetworkPolicy:
    """A multilayer perceptron: hidden layers with tanh, a linear output layer.

    Its output is clipped to [-1, 1], scaled, and put on some axes of the action; the
    other axes get zero. Without inputs the action is constant.

    Attributes:
        inputs: Names of the entries of the observation that it sees, in the order of the
            columns of the first layer.
        layers: Weight (n_out, n_in) and bias (n_out,) of each layer, float32.
        axes: The axes of the action that it acts on.
        action_scale: Its largest action.
        action_axes: All axes of the action.
        entries: Names of all entries of the observation.

    Raises:
        ConfigError: If a name is unknown, layers do not fit together, or a weight is not
            finite.
    """

    kind: ClassVar[PolicyKind] = "network"

    inputs: tuple[str, ...]
    layers: tuple[tuple[Array, Array], ...] = field(repr=False)
    axes: tuple[AxisName, ...] = COM_AXES
    action_scale: float = 1.0
    action_axes: tuple[AxisName, ...] = COM_AXES
    entries: tuple[str, ...] = field(default=tuple(DEFAULT.scales), repr=False)
    _columns: NDArray[np.intp] = field(init=False, repr=False)
    _rows: NDArray[np.intp] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        entries, action_axes = self.entries, check_axes(self.action_axes)
        store(self, inputs=check_inputs(self.inputs, entries))
        store(self, axes=check_axes(self.axes, action_axes))
        scale = check_number(
            "action_scale", self.action_scale, *ACTION_SCALE_RANGE, "of the largest action"
        )
        store(self, action_scale=scale, layers=self._checked_layers())
        store(self, _columns=np.array([entries.index(name) for name in self.inputs], np.intp))
        store(self, _rows=np.array([action_axes.index(axis) for axis in self.axes], np.intp))

    def _checked_layers(self) -> tuple[tuple[Array, Array], ...]:
        check_count("number of layers", len(self.layers), 1, MAX_HIDDEN + 1)
        widths = (len(self.inputs), *check_hidden(self.hidden), len(self.axes))
        return tuple(
            (
                check_array(
                    f"layers.{i}.weight", weight, (widths[i + 1], widths[i]), WEIGHT_LIMIT
                ),
                check_array(f"layers.{i}.bias", bias, (widths[i + 1],), WEIGHT_LIMIT),
            )
            for i, (weight, bias) in enumerate(self.layers)
        )

    @property
    def hidden(self) -> tuple[int, ...]:
        """Widths of the hidden layers."""
        return tuple(np.size(bias) for _, bias in self.layers[:-1])

    def __call__(self, observation: Array) -> Array:
        """The action for an observation, each as the environment has them."""
        values = observation[self._columns]
        for weight, bias in self.layers[:-1]:
            values = np.tanh(weight @ values + bias)
        weight, bias = self.layers[-1]
        output = np.clip(weight @ values + bias, -1.0, 1.0)
        action = np.zeros(len(self.action_axes), np.float32)
        action[self._rows] = self.action_scale * output
        return action

    def tensors(self) -> dict[str, Array]:
        """The arrays by the name that they have on disk."""
        return {
            f"layers.{i}.{name}": array
            for i, layer in enumerate(self.layers)
            for name, array in zip(("weight", "bias"), layer, strict=True)
        }
