"""Command line of train.py."""

from __future__ import annotations

import argparse
import dataclasses
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from agents.options import OPTIONS, TrainOptions, read_options
from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.output import say

_REMEDY = (
    "training needs the extra 'rl': pip install \"icub-jump[rl]\" "
    "(or stable-baselines3 and tensorboard)"
)


def run(arguments: Sequence[str]) -> None:
    """Run train.py with these arguments."""
    guarded(lambda: _run(arguments))


def _run(arguments: Sequence[str]) -> None:
    options = parse(TrainOptions, arguments, _default(arguments))
    try:
        from agents.training import train
    except ImportError as error:
        raise MissingDependencyError(_REMEDY) from error
    console = Console(stderr=True)
    try:
        train(options, console)
    except KeyboardInterrupt:
        if (options.folder / OPTIONS).exists():
            folder = shlex.quote(str(options.folder))
            say(console, f"go on with: python train.py --resume {folder}")
        raise


def _default(arguments: Sequence[str]) -> TrainOptions | None:
    """What holds where the command line says nothing.

    Found before the rest is parsed: whether that fits together depends on it.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--config", type=Path)
    parser.add_argument("--resume", type=Path)
    try:
        files, _ = parser.parse_known_args(arguments)
    except argparse.ArgumentError:
        return None  # who parses all of it finds better words
    if files.resume is None:
        return None if files.config is None else read_options(files.config)
    if files.config is not None:
        raise ConfigError("config", str(files.config), "not with --resume")
    file = files.resume / OPTIONS
    if not file.is_file():
        raise ConfigError("resume", str(files.resume), "the folder of a run")
    return dataclasses.replace(read_options(file), resume=files.resume)
