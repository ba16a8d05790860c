"""Where a result comes from: versions, configuration, seed."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import platform
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import icub_jump_env
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import TorqueConfig, VelocityConfig
from icub_jump_env.errors import ConfigError

_PACKAGES = (
    "daqp",
    "gymnasium",
    "icub-models",
    "mujoco",
    "numba",
    "numpy",
    "osqp",
    "pin",
    "scipy",
)


SOURCE = "source"
"""Where records keep :func:`source`."""


def provenance(config: JumpConfig, seed: int) -> dict[str, Any]:
    """Versions, configuration and seed of a result."""
    return {
        "versions": versions(),
        SOURCE: source(),
        "plans": plans(config),
        "controller": own_controller(config),
        "config": dataclasses.asdict(config),
        "seed": seed,
    }


@functools.cache
def source() -> str:
    """Hash of the code that a jump depends on: the package without what judges or exports it."""
    package = Path(icub_jump_env.__file__).parent
    others = {package / name for name in ("benchmark", "evaluation", "export")}
    files = sorted(package.rglob("*.py"))
    return _hash(package, [file for file in files if others.isdisjoint(file.parents)])


@functools.cache
def content(folder: Path) -> str:
    """Hash of all code and data in a folder: also what judges an episode, and plans."""
    kinds = (".py", ".json", ".safetensors")
    return _hash(folder, [file for file in sorted(folder.rglob("*")) if file.suffix in kinds])


def _hash(folder: Path, files: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def plans(config: JumpConfig) -> str | None:
    """Hash of the whole-body plans; None where nothing follows any."""
    return config.plan_family.card["sha256"] if config.planner == "whole_body" else None


def own_controller(config: JumpConfig) -> str | None:
    """Name and hash of the code of a controller of the user's own; None of ours.

    Raises:
        ConfigError: If its code is in no file.
    """
    kind = type(config.controller_config)
    return None if kind in (VelocityConfig, TorqueConfig) else code("controller", kind)


def code(field: str, what: Any) -> str:
    """Name of a class or function, and hash of the file that it is in.

    Raises:
        ConfigError: If it is in no file; names the field.
    """
    try:
        written = Path(inspect.getfile(what)).read_bytes()
    except (TypeError, OSError):
        raise ConfigError(field, what.__qualname__, "code in a file") from None
    return f"{what.__module__}.{what.__qualname__} {hashlib.sha256(written).hexdigest()[:16]}"


def versions(*more: str) -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on, and of ``more``."""
    return {
        "icub-jump": icub_jump_env.__version__,
        "python": platform.python_version(),
        **{package: metadata.version(package) for package in (*_PACKAGES, *more)},
    }


def command() -> list[str]:
    """The command that runs."""
    program, *words = sys.argv
    return [
        *(program.split() if program.startswith("icub-jump ") else ("python", program)),
        *words,
    ]
