"""Writing files, complete or not at all, and reading JSON that others wrote."""

from __future__ import annotations

import errno
import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MAX_DEPTH = 32
"""Most lists and mappings inside one another in JSON that is read."""


def read_json(text: str | bytes) -> Any:
    """The content of JSON that anybody may have written.

    Raises:
        ValueError: If it is not JSON, or nested more than :data:`MAX_DEPTH` deep.
    """
    try:
        content = json.loads(text)
    except RecursionError:
        deep = True
    else:
        deep = deeper(content, MAX_DEPTH)
    if deep:
        raise ValueError(f"nested more than {MAX_DEPTH} deep")
    return content


def deeper(value: Any, levels: int) -> bool:
    """Whether more than ``levels`` lists and mappings lie inside one another."""
    if not isinstance(value, Mapping | list | tuple):
        return False
    inner = value.values() if isinstance(value, Mapping) else value
    return levels == 0 or any(deeper(item, levels - 1) for item in inner)


def strict_json(content: Any, indent: int | None = None) -> str:
    """``content`` as JSON, with null for NaN."""
    return json.dumps(_without_nan(content), indent=indent, allow_nan=False)


def write_file(path: Path, content: bytes) -> None:
    """Write a file atomically.

    An existing file stays as it is unless the new one is complete. Links are followed;
    a device such as ``/dev/stdout`` is written to.
    """
    if path.exists() and (not path.is_file() or path.is_relative_to("/dev")):
        with path.open("ab") as device:
            device.write(content)
        return
    write_files({path: content})


def write_files(contents: Mapping[Path, bytes]) -> None:
    """Write files that belong together.

    None takes its place before all of them are complete; then they do so one after the
    other, in the order given.
    """
    temporaries: dict[Path, Path] = {}
    try:
        for path, content in contents.items():
            path = path.resolve()
            descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
            temporary = Path(name)
            temporaries[temporary] = path
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            temporary.chmod(0o644)
        for temporary, path in temporaries.items():
            temporary.replace(path)
            _sync_folder(path.parent)
    except BaseException:
        for temporary in temporaries:
            temporary.unlink(missing_ok=True)
        raise


def _sync_folder(folder: Path) -> None:
    """See that the names of files in it outlive a power cut, where the system can."""
    if os.name == "nt":  # which cannot open a folder
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some file systems cannot
            raise
    finally:
        os.close(descriptor)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
