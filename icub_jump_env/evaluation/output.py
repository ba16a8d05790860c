"""Writing results: complete or not at all."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from icub_jump_env.errors import ConfigError, printable
from icub_jump_env.files import strict_json, write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def progress_display(console: Console) -> Progress:
    """A progress display that vanishes when done, and says nothing to a file or pipe."""
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def say(console: Console, text: str) -> None:
    """Print a line: not wrapped, and nothing in it obeyed by the terminal or taken for markup."""
    console.print(printable(text), soft_wrap=True, markup=False, highlight=False)


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


def save_figure(folder: Path, name: str, figure: Figure) -> Path:
    """Write a figure into a folder, which is made if need be; returns the file."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / name)
    return folder / name


def write_json(path: Path, content: Any) -> None:
    """Write strict JSON as :func:`write_file` does; NaN, which JSON lacks, becomes null."""
    write_file(path, (strict_json(content, indent=2) + "\n").encode())
