"""Every error this package raises on purpose, with the evidence attached."""

from __future__ import annotations

from typing import Any


class ICubJumpError(Exception):
    """Base class of all errors raised by icub_jump_env."""


class InvalidValueError(ICubJumpError, ValueError):
    """A value outside its allowed range.

    Attributes:
        field: Name of the offending field or argument.
        value: The value that was given.
        allowed: What would have been accepted, in words.
    """

    def __init__(self, field: str, value: Any = None, allowed: str | None = None) -> None:
        # Gymnasium's asynchronous vector environment re-raises with the message alone.
        super().__init__(
            field if allowed is None else f"{field}={value!r} is not allowed: {allowed}"
        )
        self.field = field
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[InvalidValueError], tuple[str, Any, str | None]]:
        return type(self), (self.field, self.value, self.allowed)


class ConfigError(InvalidValueError):
    """A configuration field or a reset option is unknown or out of range."""


class ActionError(InvalidValueError):
    """An action has the wrong shape or type, or is not finite."""


class CommandNotScalableError(ConfigError):
    """No CoM trajectory of the chosen scaling reaches the commanded jump."""


class MissingDependencyError(ICubJumpError, RuntimeError):
    """An optional package or a system library is missing; the message names the remedy."""
