"""Checks of what users hand in; each refusal names the field, the value and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import ActionError, ConfigError


def store(instance: Any, **values: Any) -> None:
    """Give a frozen dataclass its checked and converted values, at its construction."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)


def check_choice(field: str, value: Any, allowed: tuple[Any, ...]) -> None:
    """Refuse anything but one of the ``allowed`` strings (or None, if among them)."""
    if (value is not None and not isinstance(value, str)) or value not in allowed:
        raise ConfigError(field, value, f"one of {', '.join(map(repr, allowed))}")


def check_flag(field: str, value: Any) -> bool:
    """Refuse anything but a boolean; return it as a bool."""
    if not isinstance(value, bool | np.bool_):
        raise ConfigError(field, value, "True or False")
    return bool(value)


def check_number(field: str, value: Any, low: float, high: float, unit: str = "") -> float:
    """Refuse anything but a real number from ``low`` to ``high`` (``unit``); return a float."""
    number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    # Compared before converting: a float cannot hold every int.
    if not number or not low <= value <= high:
        raise ConfigError(field, value, f"a number {_range(low, high, unit)}")
    return float(value)


def check_count(field: str, value: Any, low: int, high: int | None = None, unit: str = "") -> int:
    """Refuse anything but a whole number from ``low`` to ``high`` (``unit``); return an int."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < low or (high is not None and value > high):
        raise ConfigError(field, value, f"a whole number {_range(low, high, unit)}")
    return int(value)


def check_numbers(
    field: str, values: Any, length: int, low: float, high: float, unit: str = ""
) -> tuple[float, ...]:
    """Refuse anything but ``length`` numbers from ``low`` to ``high`` (``unit``)."""
    allowed = f"{length} numbers {_range(low, high, unit)}"
    # An array without axes has no length.
    listed = isinstance(values, Sequence) or (isinstance(values, np.ndarray) and values.ndim > 0)
    if not listed or len(values) != length:
        raise ConfigError(field, values, allowed)
    try:
        return tuple(check_number(field, value, low, high) for value in values)
    except ConfigError:
        raise ConfigError(field, values, allowed) from None


def check_range(
    field: str, values: Any, low: float, high: float, unit: str = ""
) -> tuple[float, float]:
    """Refuse anything but two numbers from ``low`` to ``high`` (``unit``), the lower first."""
    first, last = check_numbers(field, values, 2, low, high, unit)
    if first > last:
        raise ConfigError(field, values, "the lower bound first")
    return first, last


def check_type(field: str, value: Any, *kinds: type) -> None:
    """Refuse anything but an instance of one of the ``kinds``."""
    if not isinstance(value, kinds):
        raise ConfigError(field, value, f"an instance of {', '.join(k.__name__ for k in kinds)}")


def check_seed(seed: Any) -> int | None:
    """Refuse anything but a whole number from 0, or None."""
    return None if seed is None else check_count("seed", seed, 0)


def check_action(action: Any, size: int) -> NDArray[np.float64]:
    """Refuse anything but finite numbers; return them, clipped to [-1, 1], as float64."""
    allowed = f"{size} finite numbers, which are clipped to [-1, 1]"
    try:
        array = np.asarray(action)
    except ValueError:  # a ragged list
        raise ActionError("action", action, allowed) from None
    numbers = array.dtype.kind in "fiu" and array.shape == (size,)
    if not numbers or not all(map(math.isfinite, values := array.tolist())):
        raise ActionError("action", action, allowed)
    return np.array([min(max(value, -1.0), 1.0) for value in values], np.float64)


def is_multiple(value: float, unit: float) -> bool:
    """Whether ``value`` is a positive whole multiple of ``unit``, to rounding."""
    ratio = value / unit
    return math.isclose(ratio, round(ratio), rel_tol=1e-9) and round(ratio) >= 1


def _range(low: float, high: float | None, unit: str) -> str:
    # A whole number is written out.
    low_text, high_text = (f"{x:g}" if isinstance(x, float) else str(x) for x in (low, high))
    return f"from {low_text}{'' if high is None else f' to {high_text}'} {unit}".rstrip()
