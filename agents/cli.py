"""Command line of train.py."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.evaluation.cli import guarded, parse, seek
from icub_jump_env.evaluation.report.output import say
from icub_jump_env.evaluation.report.provenance import command
from icub_jump_env.workers import WorkerError

from .options import OPTIONS, TrainOptions, read_options


def run(arguments: Sequence[str]) -> None:
    """Run train.py with these arguments."""
    guarded(lambda: _run(arguments))


def asked(arguments: Sequence[str]) -> TrainOptions:
    """What the arguments of train.py ask for."""
    return parse(TrainOptions, arguments, _default(arguments))


def _run(arguments: Sequence[str]) -> None:
    options = asked(arguments)
    try:
        from .training import train
    except ImportError as error:
        raise MissingDependencyError.of_extra("training", "rl") from error
    console = Console(stderr=True)
    several = options.seeds is not None or options.cluster is not None
    try:
        if several:
            from .several import train_several

            train_several(options, console)
        else:
            train(options, console)
    except (KeyboardInterrupt, OSError, WorkerError):  # of which none is the run's fault
        if several:
            say(console, "the same command goes on")
        elif (options.folder / OPTIONS).exists():
            words = [*command()[:2], "--resume", str(options.folder)]
            say(console, f"go on with: {shlex.join(words)}")
        raise


def _default(arguments: Sequence[str]) -> TrainOptions | None:
    """What holds where the command line says nothing.

    Found before the rest is parsed: whether that fits together depends on it.
    """
    found = seek(arguments, "config", "resume")
    if "resume" not in found:
        return read_options(Path(found["config"][0])) if "config" in found else None
    folder = Path(found["resume"][0])
    if "config" in found:
        raise ConfigError("config", found["config"][0], "not with --resume")
    file = folder / OPTIONS
    if not file.is_file():
        raise ConfigError("resume", str(folder), "the folder of a run")
    return dataclasses.replace(read_options(file), resume=folder)
