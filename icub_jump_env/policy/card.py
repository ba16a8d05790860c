"""The card of a policy: what it is, and the environment that it was made for."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self, get_args

from icub_jump_env.checks import check_choice, check_count, check_number, check_seed, store
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, PolicyMismatchError
from icub_jump_env.observation import ObservationConfig
from icub_jump_env.planning.residual import COM_AXES, AxisName, check_axes
from icub_jump_env.policy.fields import (
    ACTION_SCALE_RANGE,
    PolicyKind,
    check_command,
    check_hidden,
    check_inputs,
    check_mapping,
    check_observation,
    check_results,
    check_versions,
)
from icub_jump_env.robot.urdf import DEFAULT_MODEL
from icub_jump_env.shortcuts import path_to

FORMAT = 1
"""Format of the files that this version reads and writes."""

TASK_FIELDS = (
    "robot",
    "controller",
    "planner",
    "estimator",
    "lean_correction",
    "flight",
    "landing",
    "com_displacement",
    "com_scaling",
    "momentum_control",
    "observation",
    "residual_axes",
    "residual_scale",
    "residual_bandwidth",
    "residual_phases",
    "control_frequency",
    "agent_frequency",
    "ankle_shift",
)
"""The fields and shortcuts of the configuration that say what an action does and when.

The others may differ from those of the training: a policy is meant for other commands,
and to be tried on other actuators, sensors and worlds; solver and physics step decide how
exactly the same is computed; rendering and ``stand_time`` do not reach it. Of a controller of
the same name, all but the solver must agree: gains, weights, limits, when phases end.
"""

BEFORE_THERE_WAS_A_CHOICE = {
    "robot": DEFAULT_MODEL,
    "planner": "scaled_curve",
    "estimator": "feet_fixed",
    "lean_correction": False,
    "flight": "minimum_jerk",
    "landing": "hold",
    "observation": ObservationConfig(),
    "residual_axes": COM_AXES,
}
"""What holds for cards that do not say these fields."""

_CONTROLLER_FREE = ("solver", "frequency", "momentum_control")
"""Fields of a controller that may differ, or are task fields by themselves."""


@dataclass(frozen=True, kw_only=True)
class PolicyCard:
    """What is known about a policy beside its numbers; a JSON file.

    Attributes:
        format: Format of the files.
        kind: Kind of the policy.
        inputs: Names of the entries of the observation that it sees.
        hidden: Widths of the hidden layers.
        axes: The axes of the action that it acts on.
        action_scale: Its largest action.
        observation: Name and scale of each entry of the observation it was trained with.
        config: The environment it was trained in; on disk, and also here, a mapping will
            do.
        versions: Version of each package.
        command: The words of the command that trained it.
        seed: Seed of the training.
        results: Numbers such as success rates, by name; lists, mappings and None may be
            among them.
        sha256: Hash of the file with the numbers, in hexadecimal; None until saved.

    Raises:
        ConfigError: If a field is of the wrong type or out of range.
    """

    format: int = FORMAT
    kind: PolicyKind
    inputs: tuple[str, ...]
    hidden: tuple[int, ...]
    axes: tuple[AxisName, ...]
    action_scale: float
    observation: tuple[tuple[str, float], ...]
    config: JumpConfig
    versions: Mapping[str, str]
    command: tuple[str, ...]
    seed: int | None
    results: Mapping[str, Any]
    sha256: str | None = None

    def __post_init__(self) -> None:
        check_count("format", self.format, FORMAT, FORMAT)
        check_choice("kind", self.kind, get_args(PolicyKind))
        observation = check_observation(self.observation)
        store(
            self,
            observation=observation,
            inputs=check_inputs(self.inputs, dict(observation)),
            hidden=check_hidden(self.hidden),
            axes=check_axes(self.axes),
            action_scale=check_number(
                "action_scale", self.action_scale, *ACTION_SCALE_RANGE, "of the largest action"
            ),
            config=_check_config(self.config),
            versions=check_versions(self.versions),
            command=check_command(self.command),
            seed=check_seed(self.seed),
            results=check_results("results", check_mapping("results", self.results)),
        )
        digest = self.sha256
        if digest is not None and not (
            isinstance(digest, str) and re.fullmatch("[0-9a-f]{64}", digest)
        ):
            raise ConfigError("sha256", digest, "64 hexadecimal digits")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """The card from the content of its file.

        Raises:
            ConfigError: If a field is missing, unknown, of the wrong type or out of range.
        """
        check_count("format", values.get("format"), FORMAT, FORMAT)
        names = {field.name for field in dataclasses.fields(cls)}
        for name in sorted(names ^ values.keys()):
            state = "not left out" if name in names else "no such field"
            allowed = f"{state}; the fields are {', '.join(sorted(names))}"
            raise ConfigError(name, values.get(name), allowed)
        return cls(**values)

    def as_trained(self, jump: JumpConfig) -> JumpConfig:
        """A jump, with what the policy depends on as it was in its training."""
        trained = {field: self.config.value_of(field) for field in TASK_FIELDS}
        return jump.replace(**trained | {"controller": self.config.controller})

    def as_dict(self) -> dict[str, Any]:
        """Mappings, lists and numbers, as JSON has them."""
        return dataclasses.asdict(self)


def mismatches(card: PolicyCard, config: JumpConfig) -> list[tuple[str, Any, Any]]:
    """In what the policy depends on, how an environment differs from the policy's.

    A policy finds the entries of the observation by name, so that their order is free.

    Returns:
        Name of each field that differs, the card's value, the environment's; None for an
        entry of the observation that one of them lacks.
    """
    theirs, ours = dict(card.observation), dict(config.layout.scales)
    pairs = [(f"observation.{name}", theirs.get(name), ours.get(name)) for name in theirs | ours]
    pairs += [(name, card.config.value_of(name), config.value_of(name)) for name in TASK_FIELDS]
    trained, given = card.config.controller_config, config.controller_config
    if type(trained) is type(given):
        pairs += [
            (f"controller.{field.name}", getattr(trained, field.name), getattr(given, field.name))
            for field in dataclasses.fields(given)
            if field.name not in _CONTROLLER_FREE
        ]
    return [pair for pair in pairs if pair[1] != pair[2]]


def check_match(card: PolicyCard, config: JumpConfig) -> None:
    """Refuse an environment that the policy was not made for.

    Raises:
        PolicyMismatchError: If it differs in anything the policy depends on; names it all.
    """
    differences = mismatches(card, config)
    if differences:
        raise PolicyMismatchError(differences)


def _check_config(config: Any) -> JumpConfig:
    if isinstance(config, JumpConfig):
        return config
    given = check_mapping("config", config)
    implied: dict[str, Any] = {} if "residual" in given else {"residual_bandwidth": 15.0}
    for field, value in BEFORE_THERE_WAS_A_CHOICE.items():
        if not _holds(given, path_to(field)):
            implied[field] = value
    explicit = implied | dict(given)
    checked = JumpConfig.of(**explicit)
    for field in TASK_FIELDS:
        # Else the policy would change with the default.
        if field not in explicit and not _holds(explicit, path_to(field)):
            raise ConfigError("config", sorted(config), f"a configuration with {field}")
    return checked


def _holds(values: Any, path: tuple[str, ...]) -> bool:
    """Whether nested mappings go on to the end of a path; a preset's name stands for all of it."""
    for step in path:
        if not isinstance(values, Mapping):
            return True
        if step not in values:
            return False
        values = values[step]
    return True
