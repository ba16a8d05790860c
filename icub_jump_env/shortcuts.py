"""Fields inside the groups of the configuration that can be given by themselves."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

from icub_jump_env.control.config import Constraints, LaunchEnd, SolverName
from icub_jump_env.errors import ConfigError, UnknownFieldError, shown
from icub_jump_env.planning.residual import AxisName, ResidualPhases
from icub_jump_env.simulation.render_config import CameraName, RenderMode


@dataclass(frozen=True)
class Shortcuts:
    """Fields inside the groups that ``gymnasium.make`` and ``eval.py`` take by themselves.

    Attributes:
        solver: QP solver.
        constraints: Whether the CoM task and the momentum constraint are constraints, as
            printed in the paper, or heavily weighted costs.
        momentum_control: Pose the constraint on the angular momentum (eq. 3d, 6d).
        control_frequency: Rate of the controller (Hz), a divisor of the physics rate; by
            default 200 for the velocity controller and 500 for the torque controller.
        launch_end: Whether the launch ends at T or at lift-off alone.
        residual_axes: What an action moves: some of forward, lateral, vertical, roll, pitch.
        residual_scale: What an action of 1 moves forward, lateral, vertical (m), roll and pitch
            (kg m^2/s) by; the last two may be left out.
        residual_bandwidth: Natural frequency of the filter that shapes the residual (rad/s).
        residual_phases: Whether the residual acts in the launch alone or in all phases.
        stand_time: How long the robot must stand after touch-down (s).
        early_end: End an episode as soon as it is known whether the robot will stand.
        render_mode: None, rgb_array or human.
        width: Of a picture (pixels).
        height: Of a picture (pixels).
        camera: Where pictures are taken from.
    """

    solver: SolverName | None = None
    constraints: Constraints | None = None
    momentum_control: bool | None = None
    control_frequency: float | None = None
    launch_end: LaunchEnd | None = None
    residual_axes: tuple[AxisName, ...] | None = None
    residual_scale: tuple[float, ...] | None = None
    residual_bandwidth: float | None = None
    residual_phases: ResidualPhases | None = None
    stand_time: float | None = None
    early_end: bool | None = None
    render_mode: RenderMode | None = None
    width: int | None = None
    height: int | None = None
    camera: CameraName | None = None


PATHS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "solver": ("controller", "solver"),
        "constraints": ("controller", "constraints"),
        "momentum_control": ("controller", "momentum_control"),
        "control_frequency": ("controller", "frequency"),
        "launch_end": ("controller", "phases", "launch_end"),
        "residual_axes": ("residual", "axes"),
        "residual_scale": ("residual", "scale"),
        "residual_bandwidth": ("residual", "bandwidth"),
        "residual_phases": ("residual", "phases"),
        "stand_time": ("success", "stand_time"),
        "early_end": ("success", "early_end"),
        "render_mode": ("rendering", "mode"),
        "width": ("rendering", "width"),
        "height": ("rendering", "height"),
        "camera": ("rendering", "camera"),
    }
)
"""Where the field is that a shortcut stands for: a group of :class:`JumpConfig`, and the way
into it."""


def path_to(name: str) -> tuple[str, ...]:
    """The way to a field or to what a shortcut stands for, from :class:`JumpConfig` on."""
    return PATHS.get(name, (name,))


@dataclass(frozen=True)
class WithShortcuts(ABC):
    """A configuration whose :class:`Shortcuts` can be given and read like its fields."""

    @property
    @abstractmethod
    def controller_config(self) -> Any:
        """The controller, by name or as given."""

    @property
    @abstractmethod
    def controller_name(self) -> str:
        """Name of the controller."""

    @classmethod
    def of(cls, **keywords: Any) -> Self:
        """Build from fields and shortcuts.

        Raises:
            UnknownFieldError: If a keyword is neither.
            ConfigError: If a value is out of range.
        """
        return cls().replace(**keywords)

    def replace(self, **changes: Any) -> Self:
        """The same with other fields or shortcuts.

        Raises:
            UnknownFieldError: If a keyword is neither.
            ConfigError: If a value is out of range.
        """
        names = [field.name for field in dataclasses.fields(self)]
        for name, value in changes.items():
            if name not in names and name not in PATHS:
                allowed = f"no such field; the fields are {', '.join([*names, *PATHS])}"
                # In Python's words, too, which TorchRL looks for.
                allowed += f" (unexpected keyword argument {shown(name)})"
                raise UnknownFieldError(name, value, allowed)
        fields = {name: value for name, value in changes.items() if name in names}
        made = dataclasses.replace(self, **fields)
        for name, value in changes.items():
            if name not in names and value is not None:
                made = made._with_shortcut(name, value)
        return made

    def _with_shortcut(self, name: str, value: Any) -> Self:
        first, *path = PATHS[name]
        group = self.controller_config if first == "controller" else getattr(self, first)
        try:
            group = _set(group, path, value)
        except ConfigError as error:
            raise type(error)(name, error.value, error.allowed) from None
        return dataclasses.replace(self, **{first: group})

    def value_of(self, name: str) -> Any:
        """The value of a field or shortcut; of the controller its name."""
        if name == "controller":
            return self.controller_name
        first, *path = path_to(name)
        value = self.controller_config if first == "controller" else getattr(self, first)
        for step in path:
            value = getattr(value, step)
        return value


def _set(group: Any, path: list[str], value: Any) -> Any:
    """A group with another value at the end of the path into it."""
    first, *rest = path
    return dataclasses.replace(
        group, **{first: _set(getattr(group, first), rest, value) if rest else value}
    )
