"""Results of the benchmark: made from episodes, written to a file, and read back from anybody's."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from icub_jump_env.benchmark.cases import CASES, EPISODES, VERSION, succeeds
from icub_jump_env.checks import check_count, check_number, check_type
from icub_jump_env.errors import FileError
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.statistics.intervals import CONFIDENCE, Interval
from icub_jump_env.evaluation.statistics.summary import Rate
from icub_jump_env.files import read_json, strict_json, write_file

LARGEST_FILE = 2**20
"""Of a result that is read (bytes)."""


@dataclass(frozen=True)
class Score:
    """What an entry does in a case.

    Attributes:
        success: Share of the episodes that succeed.
        rise: Mean rise of the CoM above its height at take-off (m).
        above_standing: Mean rise above its height in a robot that stands upright (m); of the jumps
            that leave the ground.
        failures: Number of failed episodes by class; ``not still`` is the benchmark's own.
    """

    success: Rate
    rise: float
    above_standing: float
    failures: Mapping[str, int]

    @classmethod
    def of(cls, episodes: Sequence[Episode], standing: float) -> Score:
        """Of episodes, and the CoM's height in a robot that stands upright (m)."""
        failed = [e for e in episodes if not succeeds(e)]
        kinds = Counter("not still" if e.is_success else str(e.failure) for e in failed)
        apex = np.array([e.jump["apex_height"] for e in episodes], float)
        flown = apex[~np.isnan(apex)]
        return cls(
            success=Rate(len(episodes) - len(failed), len(episodes)),
            rise=float(np.mean([e.jump["flight_height"] for e in episodes])),
            above_standing=float(flown.mean() - standing) if len(flown) else math.nan,
            failures=dict(sorted(kinds.items())),
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"success": {"count": self.success.count, "total": self.success.total}}


@dataclass(frozen=True)
class Result:
    """What an entry does in all cases.

    Attributes:
        entry: What jumped.
        scores: By case, in the order of the table.
        source: Versions, code, policy, seeds, and the configuration without what the benchmark sets.
    """

    entry: str
    scores: Mapping[str, Score]
    source: Mapping[str, Any]

    @property
    def total(self) -> tuple[float, Interval]:
        """Mean share of success over the cases, and its interval of 95 %.

        The cases are what they are; chance is in their episodes alone. With two successes and two
        failures added to each case the interval keeps its coverage where nothing fails.
        """
        rates = [score.success for score in self.scores.values()]
        mean = float(np.mean([rate.share for rate in rates]))
        added = [((rate.count + 2) / (rate.total + 4), rate.total + 4) for rate in rates]
        deviation = math.sqrt(sum(p * (1 - p) / n for p, n in added)) / len(added)
        half = float(norm.ppf((1 + CONFIDENCE) / 2)) * deviation
        return mean, (max(0.0, mean - half), min(1.0, mean + half))

    def write(self, path: Path) -> None:
        """Write the file.

        Raises:
            OSError: If the file system refuses.
        """
        content = self._content()
        text = strict_json(content | {"sha256": _digest(content)}, indent=2)
        write_file(path, f"{text}\n".encode())

    @classmethod
    def read(cls, path: Path) -> Result:
        """The result in a file.

        Raises:
            FileError: If it is damaged, no result, or of another version of the benchmark.
            OSError: If it cannot be read.
        """
        with path.open("rb") as file:
            raw = file.read(LARGEST_FILE + 1)
        try:
            if len(raw) > LARGEST_FILE:
                raise ValueError(f"larger than {LARGEST_FILE} bytes")
            content = read_json(raw)
            check_type("content", content, dict)
            digest = content.pop("sha256", None)
            if digest != _digest(content):
                raise ValueError("its hash is another one: the file was changed")
            return cls._of(content)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise FileError(str(path), f"no result of this benchmark: {error}") from error

    def _content(self) -> dict[str, Any]:
        content: dict[str, Any] = {
            "benchmark": VERSION,
            "entry": self.entry,
            "scores": {name: score.as_dict() for name, score in self.scores.items()},
            "source": dict(self.source),
        }
        read: dict[str, Any] = read_json(strict_json(content))  # as who reads it will see it
        return read

    @classmethod
    def _of(cls, content: Mapping[str, Any]) -> Result:
        check_count("benchmark", content["benchmark"], VERSION, VERSION)
        check_type("entry", content["entry"], str)
        check_type("source", content["source"], dict)
        if list(content["scores"]) != list(CASES):
            raise ValueError(f"its cases are not {', '.join(CASES)}")
        scores = {}
        for name, given in content["scores"].items():
            total = check_count("total", given["success"]["total"], EPISODES, EPISODES)
            count = check_count("count", given["success"]["count"], 0, total)
            failures = {
                str(kind): check_count(kind, n, 0) for kind, n in given["failures"].items()
            }
            scores[name] = Score(
                Rate(count, total),
                _height(given, "rise"),
                _height(given, "above_standing"),
                failures,
            )
        return cls(content["entry"], scores, content["source"])


def _height(given: Mapping[str, Any], field: str) -> float:
    return math.nan if given[field] is None else check_number(field, given[field], -1.0, 1.0, "m")


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(strict_json(dict(content)).encode()).hexdigest()
