"""Where a result comes from: versions, configuration, seed."""

from __future__ import annotations

import dataclasses
import platform
import sys
from importlib import metadata
from typing import Any

import icub_jump_env
from icub_jump_env.config import JumpConfig

_PACKAGES = ("daqp", "gymnasium", "icub-models", "mujoco", "numpy", "osqp", "pin", "scipy")


def provenance(config: JumpConfig, seed: int) -> dict[str, Any]:
    """Versions, configuration and seed of a result."""
    return {"versions": versions(), "config": dataclasses.asdict(config), "seed": seed}


def versions(*more: str) -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on, and of ``more``."""
    return {
        "icub-jump": icub_jump_env.__version__,
        "python": platform.python_version(),
        **{package: metadata.version(package) for package in (*_PACKAGES, *more)},
    }


def command() -> list[str]:
    """The command that runs."""
    return ["python", *sys.argv]
