"""The console, and files: complete or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.progress import Progress, ProgressColumn
from rich.table import Table

from icub_jump_env.errors import ConfigError, MissingDependencyError, printable
from icub_jump_env.evaluation.report.provenance import command, provenance
from icub_jump_env.files import strict_json, write_file

if TYPE_CHECKING:
    from icub_jump_env.evaluation.figures.style import Figure
    from icub_jump_env.evaluation.options import EvalOptions


def progress_display(console: Console, *columns: ProgressColumn) -> Progress:
    """A progress display that vanishes when done, and says nothing to a file or pipe."""
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def say(console: Console, text: str) -> None:
    """Print a line: not wrapped, and nothing in it obeyed by the terminal or taken for markup."""
    console.print(printable(text), soft_wrap=True, markup=False, highlight=False)


def new_table(names: int, *columns: str, title: str | None = None) -> Table:
    """A table without rows.

    Args:
        names: How many of its columns hold names; those with numbers come after.
        columns: Their headings.
        title: What stands above.
    """
    table = Table(
        title=title, title_justify="left", caption_justify="left",
        box=box.SIMPLE_HEAD, pad_edge=False,
    )  # fmt: skip
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number < names else "right", no_wrap=True)
    return table


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


def write_figures(
    folder: Path, figures: Mapping[str, Callable[[], Figure]], console: Console
) -> None:
    """Draw pictures into a folder, which is made if need be; those without OpenGL are left out."""
    from icub_jump_env.evaluation.figures.style import name_origins

    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in figures.items():
        try:
            name_origins(draw()).savefig(folder / name)
        except MissingDependencyError as error:
            say(console, f"left out {name}: {error}")
        else:
            say(console, f"wrote {folder / name}")


def write_results(
    options: EvalOptions,
    console: Console,
    found: Mapping[str, Any],
    figures: Mapping[str, Callable[[], Figure]],
) -> None:
    """Write what ``--json`` and ``--plot`` ask for, and say where.

    Args:
        options: What was asked for.
        console: Where to say it.
        found: What was found, for JSON.
        figures: What draws each picture, by its file name.
    """
    if options.json is not None:
        asked = {"mode": options.mode, "command": command()}
        write_json(options.json, {**asked, **provenance(options.config, options.seed), **found})
        say(console, f"wrote {options.json}")
    if options.plot is not None:
        write_figures(options.plot, figures, console)
