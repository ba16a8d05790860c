"""Arrays on disk: a safetensors file, and a JSON card beside it that holds its hash.

Neither can carry code. The two take their places one after the other; a reader that comes
in between, or after a crash in between, finds a hash that does not fit, never arrays with
another's card.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from icub_jump_env.errors import PolicyFileError
from icub_jump_env.files import MAX_DEPTH, deeper, read_json, strict_json, write_files

MAX_CARD_SIZE = 2**20
"""Largest card (bytes)."""


def save_tensors(path: Path, tensors: Mapping[str, NDArray[Any]], card: Mapping[str, Any]) -> None:
    """Write arrays and their card.

    Whatever fails before both are on the disk leaves an earlier pair as it was.

    Args:
        path: The ``.safetensors`` file or its ``.json`` card.
        tensors: Arrays of numbers by name.
        card: What JSON can hold; null for NaN. ``sha256`` is added.

    Raises:
        PolicyFileError: If the path, the arrays or the card are not fit for such files.
        OSError: If the file system refuses.
    """
    tensor_file, card_file = _pair(path)
    # The memory is written as it lies, which must be row by row.
    rows = {name: np.asarray(array, order="C") for name, array in tensors.items()}
    try:
        content = save(rows)
    except SafetensorError as error:
        raise PolicyFileError(str(tensor_file), str(error)) from None
    if deeper(card, MAX_DEPTH):
        raise PolicyFileError(str(card_file), f"nested more than {MAX_DEPTH} deep")
    text = strict_json({**card, "sha256": _hash(content)}, indent=2) + "\n"
    _parse(card_file, text.encode())
    write_files({tensor_file: content, card_file: text.encode()})


def load_tensors(
    path: Path, max_size: int | None = None
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read arrays and their card.

    Args:
        path: The ``.safetensors`` file or its ``.json`` card.
        max_size: Largest ``.safetensors`` file to read (bytes).

    Returns:
        The arrays by name, and the card.

    Raises:
        PolicyFileError: If one of the files is missing or damaged, or they do not belong
            together.
        OSError: If the file system refuses.
    """
    tensor_file, card_file = _pair(path)
    content = _read(tensor_file, max_size)
    card = _parse(card_file, _read(card_file, MAX_CARD_SIZE))
    if card.get("sha256") != _hash(content):
        raise PolicyFileError(
            str(tensor_file), f"damaged, or not the file that {card_file.name} was written for"
        )
    try:
        return load(content), card
    except (SafetensorError, KeyError, ValueError) as error:
        raise PolicyFileError(str(tensor_file), f"not a safetensors file ({error})") from None


def _pair(path: Path) -> tuple[Path, Path]:
    if path.suffix not in (".safetensors", ".json"):
        raise PolicyFileError(str(path), "neither a .safetensors file nor its .json card")
    return path.with_suffix(".safetensors"), path.with_suffix(".json")


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read(path: Path, max_size: int | None) -> bytes:
    if not path.is_file():
        raise PolicyFileError(str(path), "no such file")
    if max_size is not None and path.stat().st_size > max_size:
        raise PolicyFileError(str(path), f"larger than {max_size} bytes")
    return path.read_bytes()


def _parse(path: Path, text: bytes) -> dict[str, Any]:
    """The content of a card."""
    if len(text) > MAX_CARD_SIZE:
        raise PolicyFileError(str(path), f"larger than {MAX_CARD_SIZE} bytes")
    try:
        card = read_json(text)
    except ValueError as error:
        raise PolicyFileError(str(path), f"not readable as JSON ({error})") from None
    if not isinstance(card, dict):
        raise PolicyFileError(str(path), "not a JSON object")
    return card
