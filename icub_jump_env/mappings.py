"""Dataclasses from plain mappings, such as a configuration that was saved as JSON."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar, get_args, get_type_hints

from icub_jump_env.checks import check_choice
from icub_jump_env.errors import UnknownFieldError

T = TypeVar("T")


def _from_mapping(name: str, values: Mapping[str, Any], kind: type[T]) -> T:
    """A ``kind`` from a plain mapping, such as a configuration that was saved as JSON."""
    hints = get_type_hints(kind)
    for key, value in values.items():
        if key not in hints:
            allowed = f"no such field; the fields of {name} are {', '.join(hints)}"
            raise UnknownFieldError(str(key), value, allowed)
    return kind(**{key: nested(key, value, kind) for key, value in values.items()})


def nested(name: str, value: Any, owner: type) -> Any:
    """The field ``name`` of an ``owner``; where that is a dataclass, a mapping stands for it.

    Where there are several dataclasses to choose from, its ``kind`` says which.
    """
    hint = get_type_hints(owner)[name]
    options = [t for t in (hint, *get_args(hint)) if dataclasses.is_dataclass(t)]
    if not options or not isinstance(value, Mapping):
        return value
    return _from_mapping(name, value, _choose(name, value, options))


def _choose(name: str, values: Mapping[str, Any], options: list[Any]) -> Any:
    if len(options) == 1:
        return options[0]
    by_kind = {option.kind: option for option in options}
    kind = values.get("kind")
    check_choice(f"{name}.kind", kind, tuple(by_kind))
    return by_kind[kind]
