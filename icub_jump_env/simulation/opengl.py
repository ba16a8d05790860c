"""OpenGL for rendering off screen, and what to do where there is none.

MuJoCo chooses its OpenGL when it is imported, so this module imports it late.
"""

from __future__ import annotations

import os
import sys
from typing import Any

from icub_jump_env.errors import MissingDependencyError

_REMEDY = (
    "install libegl1 and libgl1 (Debian names), or set MUJOCO_GL=osmesa and install libosmesa6"
)


def has_display() -> bool:
    """Whether a window can be opened."""
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def import_mujoco() -> None:
    """Import MuJoCo for a command line.

    Raises:
        MissingDependencyError: If MuJoCo cannot load the OpenGL that MUJOCO_GL names.
    """
    try:
        import mujoco  # noqa: F401
    except Exception as error:  # each OpenGL backend fails in its own way
        backend = os.environ.get("MUJOCO_GL", "")
        raise MissingDependencyError(
            f"MuJoCo cannot start with MUJOCO_GL={backend!r} ({error}); unset it, or {_REMEDY}"
        ) from error


def open_context(width: int, height: int) -> Any:
    """Open a current off-screen OpenGL context; EGL without a display, else MuJoCo's choice.

    Raises:
        MissingDependencyError: If there is no OpenGL; the message names the remedy.
    """
    backend = os.environ.get("MUJOCO_GL", "")
    if not has_display() and backend == "glfw":
        raise MissingDependencyError("MUJOCO_GL=glfw needs a display; unset it to render with EGL")
    try:
        if not has_display() and not backend:
            from mujoco.egl import GLContext
        else:
            from mujoco.gl_context import GLContext
        context = GLContext(width, height)
        context.make_current()
    except Exception as error:  # each OpenGL backend fails in its own way
        raise MissingDependencyError(f"no OpenGL to render with ({error}): {_REMEDY}") from error
    return context
