"""Writing results: complete or not at all."""

from __future__ import annotations

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from icub_jump_env.errors import ConfigError


def progress_display(console: Console) -> Progress:
    """A progress display that vanishes when done, and says nothing to a file or pipe."""
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def say(console: Console, text: str) -> None:
    """Print a line as it is: not wrapped, and nothing in it taken for markup."""
    console.print(text, soft_wrap=True, markup=False, highlight=False)


def show(console: Console, table: Table) -> None:
    """Print a table whole, however narrow the terminal is."""
    width = console.width
    needed = console.measure(table, options=console.options.update(width=1000)).maximum
    console.width = max(width, needed)
    console.print(table)
    console.width = width


def check_writable(field: str, path: Path, folder: bool = False) -> None:
    """Refuse an output path before any work is done.

    Args:
        field: Name of the option, for the error.
        path: File to be written, or folder to be filled.
        folder: Whether ``path`` is a folder; it may not exist yet.

    Raises:
        ConfigError: If nothing can be written there.
    """
    if folder:
        if path.exists() and not path.is_dir():
            raise ConfigError(field, str(path), "a folder")
        existing = next(p for p in (path, *path.absolute().parents) if p.exists())
    else:
        if path.is_dir():
            raise ConfigError(field, str(path), "a file, not a folder")
        existing = path.parent
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise ConfigError(field, str(path), "a path in an existing, writable folder")


def write_json(path: Path, content: Any) -> None:
    """Write strict JSON as :func:`write_file` does; NaN, which JSON lacks, becomes null."""
    write_file(path, (strict_json(content, indent=2) + "\n").encode())


def strict_json(content: Any, indent: int | None = None) -> str:
    """``content`` as JSON, with null for NaN."""
    return json.dumps(_without_nan(content), indent=indent, allow_nan=False)


def write_file(path: Path, content: bytes) -> None:
    """Write a file atomically.

    An existing file stays as it is unless the new one is complete. Links are followed;
    a device such as ``/dev/stdout`` is written to.
    """
    if path.exists() and (not path.is_file() or path.is_relative_to("/dev")):
        with path.open("ab") as device:
            device.write(content)
        return
    path = path.resolve()
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    temporary = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
