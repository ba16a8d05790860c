"""What makes up a policy and its card, and the checks of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_count, check_number
from icub_jump_env.errors import ConfigError
from icub_jump_env.files import MAX_DEPTH, deeper

PolicyKind = Literal["network", "replay"]
ACTION_SCALE_RANGE = (1e-3, 1.0)

MAX_HIDDEN = 4
"""Most hidden layers."""

MAX_WIDTH = 512
"""Most neurons in one of them."""

MAX_NAME = 200
"""Longest name (characters)."""

MAX_ENTRIES = 1000
"""Most entries of an observation."""

_SCALE_RANGE = (1e-6, 1e6)
_RESULT_LIMIT = 1e30  # float32 holds it, too


def check_inputs(inputs: Any, entries: Collection[str]) -> tuple[str, ...]:
    """Refuse anything but different names of ``entries``."""
    listed = isinstance(inputs, list | tuple)
    if not listed or not all(isinstance(name, str) and name in entries for name in inputs):
        raise ConfigError("inputs", inputs, "names of entries of the observation")
    if len(set(inputs)) < len(inputs):
        raise ConfigError("inputs", inputs, "each entry at most once")
    return tuple(inputs)


def check_hidden(hidden: Any) -> tuple[int, ...]:
    """Refuse anything but the widths of at most :data:`MAX_HIDDEN` layers."""
    if not isinstance(hidden, list | tuple) or len(hidden) > MAX_HIDDEN:
        raise ConfigError("hidden", hidden, f"the widths of at most {MAX_HIDDEN} layers")
    return tuple(check_count("hidden", width, 1, MAX_WIDTH, "neurons") for width in hidden)


def check_array(
    field: str, array: Any, shape: tuple[int, ...], limit: float
) -> NDArray[np.float32]:
    """Refuse anything but a float32 array of a shape, with numbers in +- ``limit``.

    Returns:
        A contiguous copy that cannot be written to.
    """
    if not isinstance(array, np.ndarray) or array.dtype != np.float32 or array.shape != shape:
        given = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else array
        raise ConfigError(field, given, f"a float32 array of shape {shape}")
    outside = array[~(np.abs(array) <= limit)]
    if outside.size:
        raise ConfigError(field, float(outside[0]), f"numbers from {-limit:g} to {limit:g}")
    copy = np.array(array, order="C")
    copy.setflags(write=False)
    return copy


def check_name(field: str, value: Any) -> str:
    """Refuse anything but a short, printable string."""
    if not isinstance(value, str) or not value.isprintable() or not 0 < len(value) <= MAX_NAME:
        raise ConfigError(field, value, f"1 to {MAX_NAME} printable characters")
    return value


def check_mapping(field: str, value: Any) -> Mapping[Any, Any]:
    """Refuse anything but a mapping."""
    if not isinstance(value, Mapping):
        raise ConfigError(field, value, "a mapping")
    return value


def check_observation(entries: Any) -> tuple[tuple[str, float], ...]:
    """Refuse anything but pairs of name and scale, each name once."""
    listed = isinstance(entries, list | tuple) and 0 < len(entries) <= MAX_ENTRIES
    if not listed or not all(isinstance(e, list | tuple) and len(e) == 2 for e in entries):
        raise ConfigError("observation", entries, f"at most {MAX_ENTRIES} pairs: name, scale")
    checked = tuple(
        (check_name("observation", name), check_number(f"observation.{name}", s, *_SCALE_RANGE))
        for name, s in entries
    )
    if len(dict(checked)) < len(checked):
        raise ConfigError("observation", entries, "each name once")
    return checked


def check_versions(versions: Any) -> dict[str, str]:
    """Refuse anything but names with the version of each."""
    return {
        check_name("versions", name): check_name(f"versions.{name}", version)
        for name, version in check_mapping("versions", versions).items()
    }


def check_command(words: Any) -> tuple[str, ...]:
    """Refuse anything but words."""
    if not isinstance(words, list | tuple) or not all(isinstance(word, str) for word in words):
        raise ConfigError("command", words, "a list of words")
    return tuple(words)


def check_results(field: str, value: Any) -> Any:
    """Refuse anything but numbers, None, and lists and mappings of them."""
    if deeper(value, MAX_DEPTH):
        raise ConfigError(field, value, f"values nested at most {MAX_DEPTH} deep")
    return _check_results(field, value)


def _check_results(field: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        return {
            check_name(field, name): _check_results(f"{field}.{name}", item)
            for name, item in value.items()
        }
    if isinstance(value, list | tuple):
        return tuple(_check_results(field, item) for item in value)
    return None if value is None else check_number(field, value, -_RESULT_LIMIT, _RESULT_LIMIT)
