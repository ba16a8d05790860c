"""Policies on disk."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_type
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import check_own
from icub_jump_env.errors import ConfigError, PolicyFileError
from icub_jump_env.policy.card import PolicyCard, check_match
from icub_jump_env.policy.files import load_tensors, save_tensors
from icub_jump_env.policy.network import NetworkPolicy
from icub_jump_env.policy.replay import ReplayPolicy

Array = NDArray[np.float32]
SavedPolicy = NetworkPolicy | ReplayPolicy

MAX_POLICY_SIZE = 16 * 2**20
"""Largest file of a policy (bytes)."""

_SHARED_FIELDS = ("inputs", "hidden", "axes", "action_scale")


@dataclass(frozen=True, eq=False)
class LoadedPolicy:
    """A policy with its card.

    Attributes:
        policy: The policy itself.
        card: What is known about it.
    """

    policy: SavedPolicy
    card: PolicyCard

    def __call__(self, observation: Array) -> Array:
        """The action for an observation, each as the environment has them."""
        return self.policy(observation)


def save_policy(
    path: str | os.PathLike[str],
    policy: SavedPolicy,
    *,
    config: JumpConfig,
    versions: Mapping[str, str],
    command: Sequence[str],
    seed: int | None,
    results: Mapping[str, Any],
) -> None:
    """Write a policy and its card.

    Args:
        path: The ``.safetensors`` file or its ``.json`` card.
        policy: The policy.
        config: The environment it was trained in.
        versions: Version of each package.
        command: The words of the command that trained it.
        seed: Seed of the training.
        results: Numbers such as success rates, by name.

    Raises:
        ConfigError: If a field of the card is out of range.
        PolicyFileError: If the path is not fit for such files.
        OSError: If the file system refuses.
    """
    check_type("policy", policy, NetworkPolicy, ReplayPolicy)
    check_own(config.controller_config)
    if isinstance(policy, ReplayPolicy) and policy.agent_frequency != config.agent_frequency:
        raise ConfigError(
            "agent_frequency",
            policy.agent_frequency,
            f"the environment's {config.agent_frequency}",
        )
    action_axes = policy.axes if isinstance(policy, ReplayPolicy) else policy.action_axes
    if action_axes != config.residual.axes:
        raise ConfigError("axes", action_axes, f"the environment's {config.residual.axes}")
    card = PolicyCard(
        kind=policy.kind,
        observation=tuple(config.layout.scales.items()),
        config=config,
        versions=versions,
        command=tuple(command),
        seed=seed,
        results=results,
        **{field: getattr(policy, field) for field in _SHARED_FIELDS},
    )
    save_tensors(Path(path), policy.tensors(), card.as_dict())


SHIPPED = Path(__file__).with_name("shipped")
"""Folder of the policies that come with the package."""


def shipped_policies() -> list[str]:
    """Names of the policies that come with the package."""
    return sorted(file.stem for file in SHIPPED.glob("*.safetensors"))


def load_policy(path: str | os.PathLike[str], config: JumpConfig | None = None) -> LoadedPolicy:
    """Read a policy.

    Args:
        path: Name of a shipped policy, such as ``torque``; else the ``.safetensors`` file
            or its ``.json`` card.
        config: The environment it is for, if to be checked.

    Raises:
        PolicyFileError: If a file is missing, damaged, or not a policy.
        PolicyMismatchError: If the policy was made for another environment.
        OSError: If the file system refuses.
    """
    file = Path(path)
    if str(path) in shipped_policies():
        file = SHIPPED / f"{path}.safetensors"
    tensors, values = load_tensors(file, MAX_POLICY_SIZE)
    try:
        card = PolicyCard.from_mapping(values)
        # Where nothing is said of the environment, the observation at least must be its.
        check_match(card, card.config if config is None else config)
        return LoadedPolicy(_make(card, tensors), card)
    except ConfigError as error:
        raise PolicyFileError(str(path), str(error)) from error


def _make(card: PolicyCard, tensors: Mapping[str, NDArray[Any]]) -> SavedPolicy:
    """The policy of a card, which must say the same about it as its arrays."""
    policy: SavedPolicy
    if card.kind == "replay":
        _check_names(tensors, ["commands", "actions"])
        frequency = card.config.agent_frequency
        policy = ReplayPolicy(tensors["commands"], tensors["actions"], frequency, card.axes)
    else:
        names = [(f"layers.{i}.weight", f"layers.{i}.bias") for i in range(len(card.hidden) + 1)]
        _check_names(tensors, [name for layer in names for name in layer])
        layers = tuple((tensors[weight], tensors[bias]) for weight, bias in names)
        policy = NetworkPolicy(
            card.inputs,
            layers,
            card.axes,
            card.action_scale,
            card.config.residual.axes,
            tuple(card.config.layout.scales),
        )
    for field in _SHARED_FIELDS:
        given, actual = getattr(card, field), getattr(policy, field)
        if given != actual:
            raise ConfigError(field, given, f"{actual!r}, as the arrays have it")
    return policy


def _check_names(tensors: Mapping[str, Any], expected: list[str]) -> None:
    for name in sorted(tensors.keys() ^ set(expected)):
        state = "not left out" if name in expected else "no array of this policy"
        raise ConfigError("tensors", name, f"{state}; they are {', '.join(expected)}")
