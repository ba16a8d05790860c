"""MuJoCo Studio's page with the jump; to be served from a process of its own."""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import os
import queue
import socket
from typing import Any

import mujoco
from mujoco.studio import launch_thread, messages, plugin, viewer_protocol, web_viewer
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.web import web_server

from icub_jump_env.records import Array
from icub_jump_env.simulation.viewers.gate import (
    LOOPBACK,
    Answer,
    Gate,
    Handler,
    check,
    kept_from_others,
)
from icub_jump_env.simulation.viewers.screen import Caption, Command, CommandQueue, Stage

_TITLE = "iCub jump"
_MARGIN = 12.0


class _GatedSocket(socket.socket):
    """A listening socket with its gate."""

    gate: Gate


_serve = web_server.serve


def _serve_gated(
    *arguments: Any,
    sock: socket.socket,
    process_request: Handler,
    process_response: Answer,
    **options: Any,
) -> Any:
    if isinstance(sock, _GatedSocket):
        process_request = sock.gate.before(process_request)
        process_response = kept_from_others(process_response)
    options |= {"process_request": process_request, "process_response": process_response}
    return _serve(*arguments, sock=sock, **options)


# Studio has no place for it. Whether it works is tried out before a viewer is used.
web_server.serve = _serve_gated


class LoopbackViewer(web_viewer.WebViewer):  # type: ignore[misc]
    """Studio's web viewer, for this machine alone.

    Studio listens on every interface, asks for no password and loads models that are
    dropped on the page. Its second socket, between the panel and the server, is open to other
    programs on this machine: who finds its port sees the page's keys, and could draw a panel.

    Attributes:
        gate: Who is let in, and by which address.
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
        host = bound.getsockname()[0]
        if host != LOOPBACK:
            bound.close()
            raise OSError(f"MuJoCo Studio would listen on {host} instead of {LOOPBACK}")
        try:
            bound.listen()  # a browser that comes before the server is up waits
            self._kept_free = _keep_free(bound.getsockname()[1])
        except OSError:  # another program has the port
            bound.close()
            bound = socket.create_server((LOOPBACK, 0))
            self._kept_free = _keep_free(bound.getsockname()[1])
        gated = _GatedSocket(fileno=bound.detach())
        self.gate = gated.gate = Gate(gated.getsockname()[1])
        self._checked_socket = gated


def _keep_free(port: int) -> socket.socket | None:
    """Take a port of the other loopback address, so that nobody listens there.

    Browsers would ask there first, and give the token away.

    Raises:
        OSError: If somebody has it.
    """
    try:
        taken = socket.socket(socket.AF_INET6, socket.SOCK_STREAM)
    except OSError:  # a machine without IPv6
        return None
    try:
        taken.bind(("::1", port))
    except OSError as error:
        taken.close()
        if error.errno == errno.EADDRNOTAVAIL:  # likewise
            return None
        raise
    return taken


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


class Page:
    """Serves a page on this machine that shows the jump; answers a worker's requests.

    Studio's native threads can bring down their process, or hang it, where a viewer ends or meets
    the remains of another: let nothing else live there.
    """

    def open(self, model: Any) -> str:
        """Start the server, at the first free port from 8080 if there is one.

        Args:
            model: The model to show.

        Returns:
            Where the page is; whoever has it can open it.

        Raises:
            OSError: If the server does not come up, or would let anybody in.
        """
        self._stage = Stage(model)
        self._commands = CommandQueue()
        self._panel = Panel(self._commands)
        camera = mujoco.MjvCamera()
        self._stage.aim(camera)
        config = viewer_protocol.ViewerConfig(title=_TITLE, gfx="web", http_port=0)
        started: queue.SimpleQueue[LoopbackViewer | BaseException] = queue.SimpleQueue()

        def serve(endpoint: Any) -> None:
            try:
                viewer = LoopbackViewer(
                    config,
                    endpoint,
                    model=self._stage.model,
                    plugins=[self._panel],
                    camera=camera,
                )
                started.put(viewer)
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
        check(outcome.gate)
        # The viewer has this model already.
        self._handle.model, self._handle.data = self._stage.model, self._stage.data
        return outcome.gate.address

    def show(self, state: Array, caption: Caption) -> list[Command]:
        """Bring the page up to date; returns what the user asked for."""
        if not self._handle.is_running():
            return [Command.QUIT]
        self._stage.state[:], self._panel.caption = state, caption
        self._stage.set()
        self._handle.sync()
        return self._commands.take()

    def __call__(self, request: Any) -> str | list[Command]:
        """Answer a request: a model is opened, a state with its caption shown."""
        return self.show(*request) if isinstance(request, tuple) else self.open(request)

    def close(self) -> None:
        """End this process at once: Studio's own end can hang."""
        os._exit(0)
