"""What is jumped, and what counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from icub_jump_env.benchmark.worlds import WORLDS
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.simulation.randomization import Randomization

VERSION = 1
"""Of the benchmark: results of different versions are not compared."""

FIRST_SEED = 20_000
"""Seeds from here on are the benchmark's; nothing is trained or tuned on them."""
EPISODES = 100
"""Of each case."""

SUCCESS = SuccessConfig(flight_time=0.1, height_ratio=0.9, stand_time=3.0)
"""Both soles off the floor for 0.1 s, nine tenths of the command, and still on its feet 3 s after
touch-down,"""
STILL_TIME = 2.0
"""for the last of which (s) it has been still."""


@dataclass(frozen=True)
class Case:
    """Some jumps.

    Attributes:
        meaning: What they test, in words.
        jump: Fields of the configuration that the benchmark sets.
    """

    meaning: str
    jump: Mapping[str, Any]

    def of(self, entry: JumpConfig) -> JumpConfig:
        """The jumps of an entry."""
        return entry.replace(**self.jump, success=SUCCESS)


CASES: Mapping[str, Case] = MappingProxyType(
    {
        "nominal": Case(
            "4 cm, link masses within 0.1 %",
            {"jump_height": 0.04, "randomization": Randomization(link_mass=(0.999, 1.001))},
        ),
        "low": Case("2 to 4 cm, full", {"jump_height": (0.02, 0.04), "randomization": "full"}),
        "high": Case("4 to 6 cm, full", {"jump_height": (0.04, 0.06), "randomization": "full"}),
        "highest": Case("6 to 8 cm, full", {"jump_height": (0.06, 0.08), "randomization": "full"}),
        "hard": Case("4 to 6 cm, hard", {"jump_height": (0.04, 0.06), "randomization": "hard"}),
        "disturbed": Case(
            "4 to 6 cm, disturbed", {"jump_height": (0.04, 0.06), "randomization": "disturbed"}
        ),
        **{
            name: Case(
                f"4 to 6 cm, {meaning}",
                {"jump_height": (0.04, 0.06), "randomization": WORLDS[name]},
            )
            for name, meaning in (
                ("pushed", "pushed at any time"),
                ("lateral", "slopes and pushes sideways"),
                ("landing", "tilted and uneven ground"),
            )
        },
        "five": Case(
            "five jumps of 4 cm in a row, full",
            {"jump_height": 0.04, "jumps": 5, "randomization": "full"},
        ),
    }
)
"""By name, in the order of the table."""

FIXED = (
    *("jump_height", "jumps", "randomization", "success"),
    *("robot", "ankle_shift", "timestep", "self_collision"),
    *("actuators", "sensors", "command_delay"),
)
"""Fields of the configuration that an entry may not set: those of the cases, and what the robot is."""


def succeeds(episode: Episode) -> bool:
    """Whether an episode counts: the environment's success, and still at the end."""
    return episode.is_success and bool(episode.jump["still_time"] >= STILL_TIME)
