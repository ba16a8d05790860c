"""Episodes on disk, line by line as they come, so that an interrupted run keeps them."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.files import read_json, strict_json, write_file
from icub_jump_env.metrics.jump import UNDEFINED, JumpMetrics


class EpisodeLog:
    """A JSON Lines file: what was asked for, then one episode per line, each with a checksum.

    Lines come in the order in which episodes end. A finished log is sorted by seed, so
    that it does not matter how many processes worked on it and how often it was
    interrupted.

    Attributes:
        path: The file.
        episodes: Episodes in it, by seed.
        kept: Where an existing log was put, if one was in the way.
        damaged: Lines that were dropped because they are no episode, or not as written.
    """

    def __init__(self, path: Path, header: Mapping[str, Any], resume: bool) -> None:
        """Open the log.

        Args:
            path: The file; its folder is made if missing.
            header: What was asked for; decides whether a log can be resumed.
            resume: Go on with an existing log, if there is one. Else an existing one is kept
                beside the new one, under a name with a number.

        Raises:
            ConfigError: If the existing log answers another question.
        """
        self.path = path
        self.episodes: dict[int, Episode] = {}
        self._header = _sealed(header)
        self.kept: Path | None = None
        self.damaged = 0
        if path.exists():
            old_header, lines = self._read()
            if resume:
                self._take(old_header, header, lines)
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

    def _read(self) -> tuple[dict[str, Any], list[bytes]]:
        """What the log answers, and the lines of its episodes."""
        # The last part is empty, or a line that was cut off.
        first, *others = self.path.read_bytes().split(b"\n")
        try:
            header = _unsealed(first)
            if "episodes" not in header:
                raise ValueError
        except ValueError:
            raise ConfigError(
                "results", str(self.path), "a log of eval.py, or a new file"
            ) from None
        return header, others[:-1]

    def _take(
        self, old_header: Mapping[str, Any], header: Mapping[str, Any], lines: Sequence[bytes]
    ) -> None:
        header = json.loads(strict_json(header))
        for line in lines:
            try:
                episode = _episode(_unsealed(line))
            except (ValueError, TypeError, KeyError, AttributeError):
                self.damaged += 1
            else:
                self.episodes[episode.seed] = episode
        differing = _differences(old_header, header)
        first = header.get("seed", 0)
        if not self.episodes.keys() <= set(range(first, first + header["episodes"])):
            differing.append("seeds")
        if differing:
            allowed = f"a log of the same evaluation; different: {', '.join(differing)}"
            raise ConfigError("resume", str(self.path), allowed)


_SEAL = re.compile(rb'(\{.*), "crc32": "([0-9a-f]{8})"\}', re.DOTALL)


def _sealed(entry: Mapping[str, Any]) -> str:
    """A line that tells of damage: JSON with the checksum of the rest as its last entry."""
    rest = strict_json(entry)[:-1]
    return f'{rest}, "crc32": "{zlib.crc32(rest.encode()):08x}"}}'


def _unsealed(line: bytes) -> dict[str, Any]:
    """The entry of a line.

    Raises:
        ValueError: If it is no such line, or not as it was written.
    """
    seal = _SEAL.fullmatch(line)
    if seal is None or zlib.crc32(seal[1]) != int(seal[2], 16):
        raise ValueError
    entry: dict[str, Any] = read_json(seal[1] + b"}")
    return entry


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
    return _sealed({name: value for name, value in vars(episode).items() if name != "trace"})


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
        series={name: _value(value) for name, value in entry["series"].items()},
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
