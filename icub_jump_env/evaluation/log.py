"""Episodes on disk, line by line as they come, so that an interrupted run keeps them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.failures import Failure
from icub_jump_env.evaluation.output import strict_json, write_file
from icub_jump_env.evaluation.rollout import Episode
from icub_jump_env.metrics.jump import UNDEFINED


class EpisodeLog:
    """A JSON Lines file: what was asked for, then one episode per line.

    Lines come in the order in which episodes end. A finished log is sorted by seed, so
    that it does not matter how many processes worked on it and how often it was
    interrupted.

    Attributes:
        path: The file.
        episodes: Episodes in it, by seed.
    """

    def __init__(self, path: Path, header: Mapping[str, Any], resume: bool) -> None:
        """Open the log.

        Args:
            path: The file; its folder is made if missing.
            header: What was asked for; decides whether a log can be resumed.
            resume: Go on with an existing log. Else an existing one is kept beside the
                new one, under a name with a number.

        Raises:
            ConfigError: If the existing log answers another question.
        """
        self.path = path
        self.episodes: dict[int, Episode] = {}
        self._header = strict_json(header)
        path.parent.mkdir(parents=True, exist_ok=True)
        if resume and path.exists():
            self._read()
        elif path.exists():
            path.rename(_unused(path))
        # Drops half a line at the end as well.
        self._write_sorted()

    def append(self, episode: Episode) -> None:
        """Add an episode; it is on disk when this returns."""
        self.episodes[episode.seed] = episode
        with self.path.open("a") as file:
            file.write(_line(episode) + "\n")

    def finish(self) -> None:
        """Sort the episodes by seed."""
        self._write_sorted()

    def _write_sorted(self) -> None:
        lines = [self._header, *(_line(self.episodes[seed]) for seed in sorted(self.episodes))]
        write_file(self.path, "".join(line + "\n" for line in lines).encode())

    def _read(self) -> None:
        # The last part is empty, or a line that was cut off.
        *lines, _ = self.path.read_text().split("\n")
        try:
            header, *episodes = (json.loads(line) for line in lines)
            differing = _differences(header, json.loads(self._header))
            self.episodes = {e.seed: e for e in map(_episode, episodes)}
        except (ValueError, TypeError, KeyError, AttributeError):
            raise ConfigError("resume", str(self.path), "a log of eval.py") from None
        if differing:
            allowed = f"a log of the same evaluation; different: {', '.join(differing)}"
            raise ConfigError("resume", str(self.path), allowed)


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Names of the entries that differ, those of nested mappings with a dot."""
    names = []
    for name in sorted(old.keys() | new.keys()):
        ours, theirs = new.get(name), old.get(name)
        if isinstance(ours, dict) and isinstance(theirs, dict):
            names += [f"{name}.{inner}" for inner in _differences(theirs, ours)]
        elif ours != theirs:
            names.append(name)
    return names


def _line(episode: Episode) -> str:
    return strict_json(
        {
            "seed": episode.seed,
            "outcome": episode.outcome,
            "is_success": episode.is_success,
            "failure": episode.failure,
            "jump": episode.jump,
            "world": episode.world,
        }
    )


def _episode(entry: dict[str, Any]) -> Episode:
    failure = entry["failure"]
    return Episode(
        seed=entry["seed"],
        outcome=entry["outcome"],
        is_success=entry["is_success"],
        jump={name: _value(value) for name, value in entry["jump"].items()},
        failure=None if failure is None else Failure(failure),
        world={name: _value(value) for name, value in entry["world"].items()},
    )


def _value(value: Any) -> Any:
    if value is None:
        return UNDEFINED
    return tuple(map(_value, value)) if isinstance(value, list) else value


def _unused(path: Path) -> Path:
    number = 1
    while (candidate := path.with_suffix(f".{number}{path.suffix}")).exists():
        number += 1
    return candidate
