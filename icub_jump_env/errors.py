"""Every error this package raises on purpose, with the evidence attached."""

from __future__ import annotations

from typing import Any


class ICubJumpError(Exception):
    """Base class of all errors raised by icub_jump_env."""


_LONGEST = 1000
"""Characters of a value that a message shows."""


class InvalidValueError(ICubJumpError, ValueError):
    """A value outside its allowed range.

    Attributes:
        field: Name of the offending field or argument.
        value: The value that was given.
        allowed: What would have been accepted, in words.
    """

    def __init__(self, field: str, value: Any = None, allowed: str | None = None) -> None:
        # Gymnasium's asynchronous vector environment re-raises with the message alone.
        shown = repr(value)
        if len(shown) > _LONGEST:
            shown = f"{shown[:_LONGEST]}..."
        super().__init__(
            field if allowed is None else f"{field}={shown} is not allowed: {allowed}"
        )
        self.field = field
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[InvalidValueError], tuple[str, Any, str | None]]:
        return type(self), (self.field, self.value, self.allowed)


class ConfigError(InvalidValueError):
    """A configuration field or a reset option is unknown or out of range."""


class UnknownFieldError(ConfigError, TypeError):
    """There is no field of this name; a ``TypeError`` as any function's unknown keyword."""


class ActionError(InvalidValueError):
    """An action has the wrong shape or type, or is not finite."""


class CommandNotScalableError(ConfigError):
    """No CoM trajectory of the chosen scaling reaches the commanded jump."""


class MissingDependencyError(ICubJumpError, RuntimeError):
    """An optional package or a system library is missing; the message names the remedy."""


class PolicyFileError(ICubJumpError, ValueError):
    """A file of a policy or a checkpoint is missing, damaged, or something else.

    Attributes:
        path: The file.
        problem: What is wrong with it, in words.
    """

    def __init__(self, path: str, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = path
        self.problem = problem

    def __reduce__(self) -> tuple[type[PolicyFileError], tuple[str, str]]:
        return type(self), (self.path, self.problem)


class PolicyMismatchError(ICubJumpError, ValueError):
    """A policy was made for another environment.

    Attributes:
        differences: Name of each field that differs, the policy's value, the environment's.
    """

    def __init__(self, differences: list[tuple[str, Any, Any]]) -> None:
        found = "; ".join(
            f"{field}={ours!r} instead of {theirs!r}" for field, theirs, ours in differences
        )
        super().__init__(f"the environment is not the policy's: {found}")
        self.differences = differences

    def __reduce__(self) -> tuple[type[PolicyMismatchError], tuple[list[tuple[str, Any, Any]]]]:
        return type(self), (self.differences,)
