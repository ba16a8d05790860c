"""The jump in the browser, by MuJoCo Studio's web viewer; imported where that is wanted."""

from __future__ import annotations

import contextlib
import io
import logging
import queue
import socket
from typing import Any

import mujoco
from mujoco.studio import launch_thread, messages, plugin, viewer_protocol, web_viewer
from mujoco.studio.dear_imgui import dear_imgui as imgui

from icub_jump_env.simulation.viewers.screen import Caption, Command, CommandQueue, Screen

LOOPBACK = "127.0.0.1"

_TITLE = "iCub jump"
_MARGIN = 12.0


class LoopbackViewer(web_viewer.WebViewer):  # type: ignore[misc]
    """Studio's web viewer, for this machine alone.

    Studio listens on every interface and asks for no password.

    Attributes:
        port: Where the page is.
    """

    @property
    def _host(self) -> str:
        return LOOPBACK

    @_host.setter
    def _host(self, _: str) -> None:
        """Studio's choice does not matter."""

    @property
    def _http_sock(self) -> socket.socket:
        return self._checked_socket

    @_http_sock.setter
    def _http_sock(self, bound: socket.socket) -> None:
        host, self.port = bound.getsockname()[:2]
        if host != LOOPBACK:
            bound.close()
            raise OSError(f"MuJoCo Studio would listen on {host} instead of {LOOPBACK}")
        bound.listen()  # a browser that comes before the server is up waits
        self._checked_socket = bound

    def close(self) -> None:
        """Stop the server and free the interface."""
        super().close()
        # Studio can have one at a time: the next viewer crashes if this one waits for collection.
        self._headless_ui = None


class Panel(plugin.ViewerPlugin):  # type: ignore[misc]
    """Buttons, keys and a caption; runs in the viewer's thread.

    It takes the place of Studio's own panels, which change the physics.

    Attributes:
        caption: What is written there.
    """

    def __init__(self, commands: CommandQueue) -> None:
        self.caption: Caption = {}
        self._commands = commands
        self._keys = {
            imgui.Key.Space: Command.PAUSE,
            imgui.Key.RightArrow: Command.STEP,
            imgui.Key.DownArrow: Command.SLOWER,
            imgui.Key.UpArrow: Command.FASTER,
            imgui.Key.Backspace: Command.REPLAY,
        }

    @messages.handler  # type: ignore[untyped-decorator]
    def build(self, _: messages.BuildGuiEvent) -> None:
        """Build the panel of one frame."""
        for key, command in self._keys.items():
            # Held down, only the steps go on.
            if imgui.IsKeyPressed(key, command is Command.STEP):
                self._commands.put(command)
        imgui.SetNextWindowPos(imgui.Vec2(_MARGIN, _MARGIN), int(imgui.Cond.FirstUseEver))
        flags = imgui.WindowFlags
        # Without navigation by keys, which would press the button clicked last once more.
        imgui.Begin(
            _TITLE, flags=int(flags.NoTitleBar) | int(flags.AlwaysAutoResize) | int(flags.NoNav)
        )
        for label, command in (
            ("Play / pause", Command.PAUSE),
            ("Step", Command.STEP),
            ("Slower", Command.SLOWER),
            ("Faster", Command.FASTER),
            ("Replay", Command.REPLAY),
            ("Quit", Command.QUIT),
        ):
            if imgui.Button(label):
                self._commands.put(command)
            imgui.SameLine()
        imgui.NewLine()
        for name, text in self.caption.items():
            imgui.TextUnformatted(f"{name}: {text}")
        imgui.End()


class BrowserScreen(Screen):
    """Serves a page on this machine that shows the jump.

    Attributes:
        address: Where the page is.
    """

    def __init__(self, model: Any) -> None:
        """Start the server, at the first free port from 8080.

        Args:
            model: The model to show.
        """
        super().__init__(model)
        self._panel = Panel(self._commands)
        camera = mujoco.MjvCamera()
        self._stage.aim(camera)
        config = viewer_protocol.ViewerConfig(title=_TITLE, gfx="web", http_port=0)
        started: queue.SimpleQueue[int | BaseException] = queue.SimpleQueue()

        def serve(endpoint: Any) -> None:
            try:
                viewer = LoopbackViewer(
                    config,
                    endpoint,
                    model=self._stage.model,
                    plugins=[self._panel],
                    camera=camera,
                )
                started.put(viewer.port)
            except BaseException as error:
                started.put(error)
                raise
            viewer_protocol.run_viewer_loop(viewer)

        logging.getLogger("WebServer").setLevel(logging.WARNING)  # who comes and goes
        # We say ourselves where the page is.
        with contextlib.redirect_stdout(io.StringIO()):
            self._handle = launch_thread.launch_thread(serve)
            outcome = started.get()
        if isinstance(outcome, BaseException):
            raise outcome
        self.address = f"http://{LOOPBACK}:{outcome}/"
        # The viewer has this model already.
        self._handle.model, self._handle.data = self._stage.model, self._stage.data

    def refresh(self, caption: Caption) -> list[Command]:
        """Bring the page up to date; returns what the user asked for."""
        if not self._handle.is_running():
            return [Command.QUIT]
        self._stage.set()
        self._panel.caption = caption
        self._handle.sync()
        return self._commands.take()

    def close(self) -> None:
        """Stop the server."""
        self._handle.close()
