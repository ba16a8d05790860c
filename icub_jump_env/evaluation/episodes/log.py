"""Episodes on disk, line by line as they come, so that an interrupted run keeps them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.files import strict_json, write_file
from icub_jump_env.metrics.jump import UNDEFINED, JumpMetrics


class EpisodeLog:
    """A JSON Lines file: what was asked for, then one episode per line.

    Lines come in the order in which episodes end. A finished log is sorted by seed, so
    that it does not matter how many processes worked on it and how often it was
    interrupted.

    Attributes:
        path: The file.
        episodes: Episodes in it, by seed.
        kept: Where an existing log was put, if one was in the way.
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
        self.kept: Path | None = None
        if resume and not path.exists():
            raise ConfigError("resume", str(path), "a log that exists")
        if path.exists():
            old_header, episodes = self._read()
            if resume:
                self._take(old_header, episodes)
            else:
                self.kept = _unused(path)
                path.rename(self.kept)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Drops half a line at the end as well.
        self._write_sorted()

    def append(self, episode: Episode) -> None:
        """Add an episode; it survives the end of this process."""
        self.episodes[episode.seed] = episode
        with self.path.open("a") as file:
            file.write(_line(episode) + "\n")

    def finish(self) -> None:
        """Sort the episodes by seed."""
        self._write_sorted()

    def _write_sorted(self) -> None:
        lines = [self._header, *(_line(self.episodes[seed]) for seed in sorted(self.episodes))]
        write_file(self.path, "".join(line + "\n" for line in lines).encode())

    def _read(self) -> tuple[dict[str, Any], list[Episode]]:
        try:
            # The last part is empty, or a line that was cut off.
            *lines, _ = self.path.read_text().split("\n")
            header, *entries = (json.loads(line) for line in lines)
            if not isinstance(header, dict) or "episodes" not in header:
                raise ValueError
            return header, [_episode(entry) for entry in entries]
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise ConfigError(
                "results", str(self.path), "a log of eval.py, or a new file"
            ) from None

    def _take(self, old_header: Mapping[str, Any], episodes: Sequence[Episode]) -> None:
        header = json.loads(self._header)
        differing = _differences(old_header, header)
        first = header.get("seed", 0)
        if not {e.seed for e in episodes} <= set(range(first, first + header["episodes"])):
            differing.append("seeds")
        if differing:
            allowed = f"a log of the same evaluation; different: {', '.join(differing)}"
            raise ConfigError("resume", str(self.path), allowed)
        self.episodes = {episode.seed: episode for episode in episodes}


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
    return strict_json({name: value for name, value in vars(episode).items() if name != "trace"})


def _episode(entry: dict[str, Any]) -> Episode:
    failure, jump = entry["failure"], entry["jump"]
    if type(entry["seed"]) is not int or type(entry["is_success"]) is not bool:
        raise TypeError
    metrics = JumpMetrics().as_dict()
    if jump.keys() != metrics.keys():
        raise KeyError
    return Episode(
        seed=entry["seed"],
        jump_height=float(entry["jump_height"]),
        outcome=entry["outcome"],
        is_success=entry["is_success"],
        reward=float(entry["reward"]),
        jump={name: _like(metrics[name], _value(value)) for name, value in jump.items()},
        failure=None if failure is None else Failure(failure),
        world={name: _value(value) for name, value in entry["world"].items()},
    )


def _like(example: Any, value: Any) -> Any:
    """``value``, refused if it is of another type than the ``example``."""
    if isinstance(value, float) != isinstance(example, float) or (
        isinstance(value, bool | tuple | str) and not isinstance(value, type(example))
    ):
        raise TypeError
    return value


def _value(value: Any) -> Any:
    if value is None:
        return UNDEFINED
    return tuple(map(_value, value)) if isinstance(value, list) else value


def _unused(path: Path) -> Path:
    number = 1
    while (candidate := path.with_suffix(f".{number}{path.suffix}")).exists():
        number += 1
    return candidate
