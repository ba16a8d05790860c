"""The registered environments."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal

EnvName = Literal["ICubJump-v0", "ICubJump-v1"]
ENV_ID = "ICubJump-v0"
VERSIONS: Mapping[EnvName, Mapping[str, Any]] = MappingProxyType(
    {
        "ICubJump-v0": {},
        "ICubJump-v1": {
            "planner": "whole_body",
            "estimator": "imu",
            "lean_correction": True,
            "flight": "feedback",
            "landing": "feedback",
        },
    }
)
"""Where their defaults are not those of :class:`icub_jump_env.config.JumpConfig`."""


def env_of(config: Any) -> EnvName:
    """The newest environment whose defaults a configuration has."""
    fitting = [
        name
        for name, fields in VERSIONS.items()
        if all(getattr(config, field) == value for field, value in fields.items())
    ]
    return fitting[-1]


MAX_EPISODE_STEPS = 1_000_000
"""Guard only: every episode ends by itself."""
