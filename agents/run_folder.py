"""A run has its folder to itself."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from icub_jump_env.errors import ICubJumpError


class RunLockedError(ICubJumpError, RuntimeError):
    """Another process writes to the run's folder."""


@contextlib.contextmanager
def lock_run(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder, which is made if need be.

    The system lifts the lock when this process ends, in whatever way.

    Args:
        folder: Where the run writes.

    Raises:
        RunLockedError: If another run, or another one of this process, has it.
        OSError: If the file system refuses, or the file that holds the lock is a link.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # Not through a link: the file is overwritten.
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
    with os.fdopen(os.open(folder / ".lock", flags, 0o644), "r+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            holder = file.read(20) or "unknown"  # it is about to say
            raise RunLockedError(f"{folder} is in use by another run, process {holder}") from None
        # The file stays: one who opened it would hold a lock on what another removes.
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        try:
            yield
        finally:
            file.truncate(0)
