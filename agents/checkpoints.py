"""Checkpoints of a training: a run that continues from one equals a run that never stopped."""

from __future__ import annotations

import hashlib
import math
import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO

from icub_jump_env.checks import check_count, check_type
from icub_jump_env.errors import ConfigError, ICubJumpError, PolicyFileError, shown
from icub_jump_env.files import strict_json
from icub_jump_env.policy.files import load_tensors, save_tensors

from .vec_env import JumpVecEnv

MAX_CHECKPOINT_SIZE = 64 * 2**20
"""Largest file of a checkpoint (bytes); that of the largest networks has a third."""

_NAME = re.compile(r"checkpoint-(\d{6,})\.(safetensors|json)")
_TENSOR = re.compile(r"policy\.[\w.]+|optimizer\.\d+\.(step|exp_avg|exp_avg_sq)")
_FINGERPRINT = "card"
"""Name of the array that holds the hash of the card, whose own hash is of the arrays alone."""


class CheckpointError(ICubJumpError, RuntimeError):
    """No checkpoint is intact, or one does not fit the model."""


@dataclass(frozen=True)
class Checkpoint:
    """What a checkpoint holds.

    Attributes:
        number: Its number.
        tensors: Parameters of the policy and state of its optimizer.
        param_groups: Settings of the optimizer.
        num_timesteps: Environment steps so far.
        n_updates: Passes over the data so far.
        progress: What the training noted.
    """

    number: int
    tensors: Mapping[str, NDArray[Any]]
    param_groups: list[dict[str, Any]]
    num_timesteps: int
    n_updates: int
    progress: dict[str, Any]


def save_checkpoint(folder: Path, model: PPO, number: int, progress: Mapping[str, Any]) -> Path:
    """Write a checkpoint, and remove those before its predecessor once it is complete.

    Args:
        folder: Where checkpoints are.
        model: What to save. Neither its rollout nor the state of generators and
            environments is saved: see :func:`begin_segment`.
        number: Larger than those of the intact checkpoints so far.
        progress: Whatever the training needs besides; must be representable in JSON.

    Returns:
        The file, beside which its card lies.

    Raises:
        OSError: If it cannot be written. Older checkpoints remain, and nothing of the new.
        PolicyFileError: If ``progress`` is too large.
    """
    optimizer = model.policy.optimizer.state_dict()
    tensors = {f"policy.{name}": value for name, value in model.policy.state_dict().items()}
    for index, state in optimizer["state"].items():
        tensors |= {f"optimizer.{index}.{key}": value for key, value in state.items()}
    arrays = {name: value.numpy() for name, value in tensors.items()}
    card = {
        "number": number,
        "param_groups": optimizer["param_groups"],
        "num_timesteps": model.num_timesteps,
        "n_updates": model._n_updates,
        "progress": dict(progress),
    }
    path = _path(folder, number)
    save_tensors(path, arrays | {_FINGERPRINT: _fingerprint(card)}, card)
    for old in [other for other in _numbers(folder) if other < number][:-1]:
        _path(folder, old).with_suffix(".json").unlink(missing_ok=True)
        _path(folder, old).unlink(missing_ok=True)
    return path


def load_latest(folder: Path, say: Callable[[str], None]) -> Checkpoint | None:
    """Read the newest intact checkpoint.

    Args:
        folder: Where checkpoints are.
        say: Is told of damaged ones that are passed over.

    Returns:
        The checkpoint, or None if there is none at all.

    Raises:
        CheckpointError: If all are damaged.
    """
    damaged: list[str] = []
    for number in reversed(_numbers(folder)):
        path = _path(folder, number)
        try:
            checkpoint = _load(path, number)
        except PolicyFileError as error:
            damaged.append(str(error))
            continue
        for message in damaged:
            say(f"{message}; {path.name} is used instead")
        return checkpoint
    if damaged:
        raise CheckpointError(f"no checkpoint in {folder} is intact: {'; '.join(damaged)}")
    return None


def restore(model: PPO, checkpoint: Checkpoint) -> None:
    """Put a checkpoint's content back into a model, bit for bit.

    Args:
        model: Made as the one that was saved.
        checkpoint: What to restore.

    Raises:
        CheckpointError: If it does not fit the model, which is of no use then.
    """
    problem = _misfit(model, checkpoint)
    if problem is not None:
        raise CheckpointError(f"checkpoint {checkpoint.number} does not fit the model: {problem}")
    parameters: dict[str, torch.Tensor] = {}
    state: dict[int, dict[str, torch.Tensor]] = defaultdict(dict)
    try:
        for name, array in checkpoint.tensors.items():
            owner, rest = name.split(".", 1)
            if owner == "policy":
                parameters[rest] = torch.tensor(array)
            else:
                index, key = rest.split(".")
                state[int(index)][key] = torch.tensor(array)
        # Adam's betas are a tuple, which JSON lacks.
        groups = [group | {"betas": tuple(group["betas"])} for group in checkpoint.param_groups]
        model.policy.load_state_dict(parameters)
        model.policy.optimizer.load_state_dict({"state": dict(state), "param_groups": groups})
    except (RuntimeError, ValueError, TypeError, KeyError) as error:
        message = f"checkpoint {checkpoint.number} does not fit the model: {error}"
        raise CheckpointError(message) from error
    model.num_timesteps = checkpoint.num_timesteps
    model._n_updates = checkpoint.n_updates


def begin_segment(model: PPO, seed: int, number: int) -> list[int]:
    """Start the part of a training that follows a checkpoint, or its first.

    All that the following steps depend on, but for what a checkpoint holds, becomes a
    function of the arguments: the generators of Python, NumPy, torch and the action space,
    the environments, the number of threads. So it need not be saved. Call it where a
    rollout begins: in a callback's ``_on_rollout_start``.

    Args:
        model: Its environment is a :class:`JumpVecEnv`, without wrappers around it.
        seed: Seed of the run.
        number: Number of the checkpoint, 0 at the start of the run.

    Returns:
        The seeds with which the environments were reset.
    """
    env = model.get_env()
    assert isinstance(env, JumpVecEnv)  # a wrapper's own state would be lost
    first, *seeds = _words(seed, number, env.num_envs)
    torch.set_num_threads(1)
    model.set_random_seed(first)
    model._last_obs = env.reset_all(seeds)
    model._last_episode_starts = np.ones(env.num_envs, dtype=bool)
    for buffer in (model.ep_info_buffer, model.ep_success_buffer):
        if buffer is not None:  # else learn() has yet to make it
            buffer.clear()
    return seeds


def segment_seeds(seed: int, number: int, num_envs: int) -> list[int]:
    """The seeds with which :func:`begin_segment` resets the environments."""
    return _words(seed, number, num_envs)[1:]


def _words(seed: int, number: int, num_envs: int) -> list[int]:
    return [int(w) for w in np.random.SeedSequence([seed, number]).generate_state(1 + num_envs)]


def _load(path: Path, number: int) -> Checkpoint:
    arrays, card = load_tensors(path, MAX_CHECKPOINT_SIZE)
    card_file = str(path.with_suffix(".json"))
    del card["sha256"]
    if not np.array_equal(arrays.pop(_FINGERPRINT, ()), _fingerprint(card)):
        raise PolicyFileError(card_file, "damaged")
    try:
        checkpoint = Checkpoint(tensors=arrays, **card)
        if type(checkpoint.number) is not int or checkpoint.number != number:
            raise ConfigError("number", checkpoint.number, f"{number}, as the file is called")
        _check(checkpoint)
    except TypeError:
        raise PolicyFileError(card_file, "of another version") from None
    except ConfigError as error:
        raise PolicyFileError(card_file, str(error)) from None
    return checkpoint


def _check(checkpoint: Checkpoint) -> None:
    """Refuse what no training wrote.

    Raises:
        ConfigError: If a value is of the wrong type or out of range.
    """
    for field in ("num_timesteps", "n_updates"):
        check_count(field, getattr(checkpoint, field), 0)
    check_type("progress", checkpoint.progress, dict)
    groups = checkpoint.param_groups
    if not isinstance(groups, list) or not all(isinstance(group, dict) for group in groups):
        raise ConfigError("param_groups", groups, "a list of mappings")
    for name, array in checkpoint.tensors.items():
        if not _TENSOR.fullmatch(name):
            raise ConfigError("tensors", name, "parameters, and the state of Adam")
        if array.dtype != np.float32:
            raise ConfigError(name, str(array.dtype), "float32")
        if not np.isfinite(array).all():
            raise ConfigError(name, float(array[~np.isfinite(array)][0]), "finite numbers")


def _misfit(model: PPO, checkpoint: Checkpoint) -> str | None:
    """What torch takes without a complaint though it is not the model's."""
    optimizer = model.policy.optimizer
    shapes = [tuple(p.shape) for group in optimizer.param_groups for p in group["params"]]
    for name, array in checkpoint.tensors.items():
        if not _TENSOR.fullmatch(name):
            return f"{shown(name)} is none of its tensors"
        owner, *rest = name.split(".")
        if owner == "optimizer":
            index, key = int(rest[0]), rest[1]
            if index >= len(shapes):
                return f"it has no parameter {index}"
            shape = () if key == "step" else shapes[index]
            if array.shape != shape:
                return f"{name} has shape {array.shape} instead of {shape}"
    ours = optimizer.state_dict()["param_groups"]
    theirs = checkpoint.param_groups
    if not isinstance(theirs, list) or len(theirs) != len(ours):
        return f"{len(ours)} groups of parameters are missing"
    for mine, group in zip(ours, theirs, strict=True):
        for key, value in mine.items():
            given = group.get(key)
            kind = list if isinstance(value, tuple) else type(value)
            numbers = given if isinstance(given, list) else [given]
            finite = all(not isinstance(x, float) or math.isfinite(x) for x in numbers)
            if type(given) is not kind or not finite:
                return f"{key}={shown(given)} instead of such as {shown(value)}"
    return None


def _fingerprint(card: Mapping[str, Any]) -> NDArray[np.uint8]:
    """Hash of a card's content: the same for what is written and for what is read."""
    return np.frombuffer(hashlib.sha256(strict_json(card).encode()).digest(), np.uint8)


def _path(folder: Path, number: int) -> Path:
    return folder / f"checkpoint-{number:06d}.safetensors"


def _numbers(folder: Path) -> list[int]:
    """Of the checkpoints, or remains of some, in ascending order."""
    names = (_NAME.fullmatch(path.name) for path in folder.glob("*"))
    return sorted({int(name[1]) for name in names if name})
