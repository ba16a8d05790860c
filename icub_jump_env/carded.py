"""A file and the JSON card beside it, which holds its hash.

The two take their places one after the other; a reader that comes in between, or after a crash
in between, finds a hash that does not fit, never a file with another's card.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from icub_jump_env.errors import FileError
from icub_jump_env.files import MAX_DEPTH, deeper, read_json, strict_json, write_files

MAX_CARD_SIZE = 2**20
"""Largest card (bytes)."""


def write_carded(
    path: Path, content: bytes, card: Mapping[str, Any], error: type[FileError]
) -> None:
    """Write a file and its card, ``path`` with the suffix ``.json``.

    Whatever fails before both are on the disk leaves an earlier pair as it was.

    Args:
        path: The file.
        content: What it holds.
        card: What JSON can hold; null for NaN. ``sha256`` is added.
        error: What is raised.

    Raises:
        FileError: If the card is not fit for such a file.
        OSError: If the file system refuses.
    """
    card_file = path.with_suffix(".json")
    if deeper(card, MAX_DEPTH):
        raise error(str(card_file), f"nested more than {MAX_DEPTH} deep")
    text = (strict_json({**card, "sha256": _hash(content)}, indent=2) + "\n").encode()
    _parse(card_file, text, error)
    write_files({path: content, card_file: text})


def read_carded(
    path: Path, max_size: int | None, error: type[FileError]
) -> tuple[bytes, dict[str, Any]]:
    """Read a file and its card.

    Args:
        path: The file.
        max_size: Largest file to read (bytes).
        error: What is raised.

    Raises:
        FileError: If one of the two is missing or damaged, or they do not belong together.
        OSError: If the file system refuses.
    """
    card_file = path.with_suffix(".json")
    content = _read(path, max_size, error)
    card = _parse(card_file, _read(card_file, MAX_CARD_SIZE, error), error)
    if card.get("sha256") != _hash(content):
        problem = f"damaged, or not the file that {card_file.name} was written for"
        raise error(str(path), problem)
    return content, card


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read(path: Path, max_size: int | None, error: type[FileError]) -> bytes:
    if not path.is_file():
        raise error(str(path), "no such file")
    if max_size is not None and path.stat().st_size > max_size:
        raise error(str(path), f"larger than {max_size} bytes")
    return path.read_bytes()


def _parse(path: Path, text: bytes, error: type[FileError]) -> dict[str, Any]:
    """The content of a card."""
    if len(text) > MAX_CARD_SIZE:
        raise error(str(path), f"larger than {MAX_CARD_SIZE} bytes")
    try:
        card = read_json(text)
    except ValueError as problem:
        raise error(str(path), f"not readable as JSON ({problem})") from None
    if not isinstance(card, dict):
        raise error(str(path), "not a JSON object")
    return card
