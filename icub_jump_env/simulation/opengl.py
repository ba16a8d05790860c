"""Which OpenGL MuJoCo uses. It chooses when it is imported, so this module does not import it."""

from __future__ import annotations

import os
import sys

from icub_jump_env.errors import MissingDependencyError

NO_OPENGL = (
    "no OpenGL to render with; on a machine without a display install libegl1 and libgl1 "
    "(Debian names) and set MUJOCO_GL=egl before Python starts"
)


def has_display() -> bool:
    """Whether a window can be opened."""
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def check_offscreen() -> None:
    """Refuse early if MuJoCo would look for a display that is not there.

    Raises:
        MissingDependencyError: Naming the remedy.
    """
    if not has_display() and os.environ.get("MUJOCO_GL", "") in ("", "glfw"):
        raise MissingDependencyError(NO_OPENGL)


def import_mujoco(offscreen: bool) -> None:
    """Import MuJoCo for a command line.

    Args:
        offscreen: Whether pictures will be rendered. Without a display that takes EGL,
            which is chosen unless ``MUJOCO_GL`` says otherwise.

    Raises:
        MissingDependencyError: If MuJoCo cannot load the OpenGL it was told to use.
    """
    if offscreen and not has_display():
        os.environ.setdefault("MUJOCO_GL", "egl")
    try:
        import mujoco  # noqa: F401
    except Exception as error:  # each OpenGL backend fails in its own way
        raise MissingDependencyError(
            f"MuJoCo cannot start with MUJOCO_GL={os.environ.get('MUJOCO_GL', '')!r} ({error}); "
            "install libegl1 and libgl1 (Debian names) for egl, or unset MUJOCO_GL"
        ) from error
