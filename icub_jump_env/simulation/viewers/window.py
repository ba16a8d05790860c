"""MuJoCo's own viewer."""

from __future__ import annotations

import sys
import threading
import warnings
from typing import Any

from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.simulation.opengl import has_display
from icub_jump_env.simulation.viewers.screen import Caption, Command, CommandQueue, Screen

CLOSING_TIME = 5.0
"""Longest time (s) to wait for a window to close."""

_NO_WINDOW = (
    "no window can be opened here: that needs a display and OpenGL; without them, "
    "render_mode='rgb_array' makes pictures, and eval.py --view shows the jump in the browser"
)


class WindowScreen(Screen):
    """MuJoCo's own viewer."""

    def __init__(self, model: Any) -> None:
        """Open the window.

        Raises:
            MissingDependencyError: If that is impossible.
        """
        check_window()
        import glfw
        import mujoco.viewer

        super().__init__(model)
        self._commands = CommandQueue()
        self._keys = {
            glfw.KEY_SPACE: Command.PAUSE,
            glfw.KEY_RIGHT: Command.STEP,
            glfw.KEY_DOWN: Command.SLOWER,
            glfw.KEY_UP: Command.FASTER,
            glfw.KEY_BACKSPACE: Command.REPLAY,
        }
        others = threading.enumerate()
        try:
            self._viewer = mujoco.viewer.launch_passive(
                self._stage.model,
                self._stage.data,
                key_callback=self._press,
                show_left_ui=False,
                show_right_ui=False,
            )
        except RuntimeError as error:  # on macOS only mjpython can open a window
            raise MissingDependencyError(f"{_NO_WINDOW} ({error})") from error
        self._threads = [thread for thread in threading.enumerate() if thread not in others]
        with self._viewer.lock():
            self._stage.aim(self._viewer.cam)

    def _press(self, key: int) -> None:
        if key in self._keys:
            self._commands.put(self._keys[key])

    def refresh(self, caption: Caption) -> list[Command]:
        """Bring the window up to date; returns what the user asked for."""
        if not self._viewer.is_running():
            return [Command.QUIT]
        self._stage.set()
        self._viewer.set_texts((None, None, "\n".join(caption), "\n".join(caption.values())))
        self._viewer.sync()
        return self._commands.take()

    def close(self) -> None:
        """Close the window."""
        self._viewer.close()
        # Python must not end while they draw: that crashes.
        for thread in self._threads:
            thread.join(CLOSING_TIME)


def check_window() -> None:
    """Refuse where MuJoCo's viewer would wait for a window for ever.

    Raises:
        MissingDependencyError: If no window can be opened.
    """
    if not has_display():
        raise MissingDependencyError(_NO_WINDOW)
    if not sys.platform.startswith("linux"):
        return
    window = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import glfw  # warns of what we report

        if glfw.init():
            glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
            window = glfw.create_window(1, 1, "", None, None)
            glfw.default_window_hints()
    if not window:
        raise MissingDependencyError(_NO_WINDOW)
    glfw.destroy_window(window)
