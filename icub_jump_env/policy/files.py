"""Arrays on disk: a safetensors file, and a JSON card beside it; neither can carry code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from icub_jump_env.carded import read_carded, write_carded
from icub_jump_env.errors import PolicyFileError


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
    tensor_file = _tensor_file(path)
    # The memory is written as it lies, which must be row by row.
    rows = {name: np.asarray(array, order="C") for name, array in tensors.items()}
    try:
        content = save(rows)
    except SafetensorError as error:
        raise PolicyFileError(str(tensor_file), str(error)) from None
    write_carded(tensor_file, content, card, PolicyFileError)


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
    tensor_file = _tensor_file(path)
    content, card = read_carded(tensor_file, max_size, PolicyFileError)
    try:
        return load(content), card
    except (SafetensorError, KeyError, ValueError) as error:
        raise PolicyFileError(str(tensor_file), f"not a safetensors file ({error})") from None


def _tensor_file(path: Path) -> Path:
    if path.suffix not in (".safetensors", ".json"):
        raise PolicyFileError(str(path), "neither a .safetensors file nor its .json card")
    return path.with_suffix(".safetensors")
