"""Compilation of the small functions on arrays that each control tick and physics step runs.

They are plain functions. Numba compiles each at its first call and keeps the result on disk, beside
the source or where ``NUMBA_CACHE_DIR`` says. No fast math: what is compiled rounds as it is
written, in any process.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = __name__.partition(".")[0]


def _sources() -> bytes:
    """Hash of all source of this package."""
    total = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        total.update(file.read_bytes())
    return total.digest()


_SOURCES = _sources()


def compiled(function: Function) -> Function:
    """The function, compiled; it runs without the global lock."""
    made: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    # Numba takes what it kept for current if the file of the function is as it was, whatever became
    # of the functions and constants that it takes from others.
    kept = made._cache._cache_file
    kept._source_stamp = kept._source_stamp, _SOURCES
    return cast("Function", made)


class _Word(event.Listener):
    """Says, once in a process, what the user waits for."""

    def __init__(self) -> None:
        self._said = False

    def on_start(self, event: event.Event) -> None:
        function = event.data["dispatcher"].py_func
        if not self._said and function.__module__.partition(".")[0] == _PACKAGE:
            print(f"{_PACKAGE}: compiling, once for each kind of jump", file=sys.stderr)
            self._said = True

    def on_end(self, event: event.Event) -> None:
        """Nothing to say."""


event.register("numba:compile", _Word())
