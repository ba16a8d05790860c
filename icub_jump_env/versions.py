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

MAX_EPISODE_STEPS = 1_000_000
"""Guard only: every episode ends by itself."""
