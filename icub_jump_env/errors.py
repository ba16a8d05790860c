"""Every error this package raises on purpose, with the evidence attached."""

from __future__ import annotations

import reprlib
from typing import Any

_LONGEST_VALUE = 500
_LONGEST_MESSAGE = 2000
"""Characters that are shown of a value, and of a message."""

_REFUSALS = ("not ", "no ", "only ", "left to ")
"""How what is allowed begins where it says when a value is not."""

_values = reprlib.Repr()
_values.maxlist = _values.maxtuple = _values.maxset = _values.maxfrozenset = 30
_values.maxdict = 30
_values.maxstring = _values.maxlong = _values.maxother = 200


def printable(text: str) -> str:
    """``text`` with whatever a terminal would obey, line breaks among them, as an escape."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str, longest: int = _LONGEST_MESSAGE) -> str:
    """``text`` as one printable line of at most ``longest`` characters."""
    line = printable(" ".join(text[: 2 * longest].split()))
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


def shown(value: Any) -> str:
    """What a message shows of a value, whatever its ``repr`` does."""
    try:
        text = _values.repr(value)
    except Exception:  # whatever its class does wrong: it is about to be refused
        text = f"<{type(value).__name__}>"
    return one_line(text, _LONGEST_VALUE)


class ICubJumpError(Exception):
    """Base class of all errors raised by icub_jump_env; the message is one printable line."""

    def __init__(self, message: str = "") -> None:
        super().__init__(one_line(message))


class InvalidValueError(ICubJumpError, ValueError):
    """A value outside its allowed range.

    Attributes:
        field: Name of the offending field or argument.
        value: The value that was given.
        allowed: What would have been accepted, in words.
    """

    def __init__(self, field: str, value: Any = None, allowed: str | None = None) -> None:
        message = field  # alone, as Gymnasium's asynchronous vector environment raises it again
        if allowed is not None:
            reason = allowed if allowed.startswith(_REFUSALS) else f"expected {allowed}"
            message = f"{one_line(field, _LONGEST_VALUE)}={shown(value)} is not allowed: {reason}"
        super().__init__(message)
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
    """An action has the wrong shape or type, or a number that is not finite."""


class CommandNotScalableError(ConfigError):
    """No CoM trajectory of the chosen scaling reaches the commanded jump."""


class PlanningError(ICubJumpError, RuntimeError):
    """No plan keeps the limits."""


class HeightNotReachableError(ConfigError):
    """No plan of the robot reaches the commanded height."""


class MissingDependencyError(ICubJumpError, RuntimeError):
    """An optional package or a system library is missing; the message names the remedy."""

    @classmethod
    def of_extra(cls, purpose: str, extra: str) -> MissingDependencyError:
        """What is missing comes with an extra of this package."""
        remedy = f'in the repository\'s folder: pip install -c constraints.txt -e ".[{extra}]"'
        return cls(f"{purpose} needs the extra {extra!r}, {remedy}")


class FileError(ICubJumpError, ValueError):
    """A file is missing, damaged, or something else.

    Attributes:
        path: The file.
        problem: What is wrong with it, in words.
    """

    def __init__(self, path: str, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = path
        self.problem = problem

    def __reduce__(self) -> tuple[type[FileError], tuple[str, str]]:
        return type(self), (self.path, self.problem)


class PolicyFileError(FileError):
    """A file of a policy or a checkpoint."""


class PlanFileError(FileError):
    """A file of plans; also if they are of another robot or controller."""


class PolicyMismatchError(ICubJumpError, ValueError):
    """A policy was made for another environment.

    Attributes:
        differences: Name of each field that differs, the policy's value, the environment's.
    """

    def __init__(self, differences: list[tuple[str, Any, Any]]) -> None:
        found = "; ".join(
            f"{field}={shown(ours)} instead of {shown(theirs)}"
            for field, theirs, ours in differences
        )
        super().__init__(f"the environment is not the policy's: {found}")
        self.differences = differences

    def __reduce__(self) -> tuple[type[PolicyMismatchError], tuple[list[tuple[str, Any, Any]]]]:
        return type(self), (self.differences,)
