"""The jump in the browser, by MuJoCo Studio's web viewer; imported where that is wanted."""

from __future__ import annotations

import contextlib
import http.client
import io
import logging
import queue
import secrets
import socket
from collections.abc import Callable
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs

import mujoco
from mujoco.studio import launch_thread, messages, plugin, viewer_protocol, web_viewer
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.web import web_server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from icub_jump_env.simulation.viewers.screen import Caption, Command, CommandQueue, Screen

LOOPBACK = "127.0.0.1"

_TITLE = "iCub jump"
_MARGIN = 12.0
_PATIENCE = 10.0
"""Longest time (s) until the server answers for the first time."""

_Process = Callable[[Any, Request], Response | None]
_Answer = Callable[[Any, Request, Response], Response | None]

_COOKIE = "icub_jump"
_LETS_IN_ALL = "Access-Control-Allow-Origin"
_FOR_ITS_PAGE = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Headers of all answers."""


class Gate:
    """Lets in who knows the address that was printed, and takes no files.

    The address holds a token; the page's own requests, which lack it, carry the cookie that
    the page brought. Pages of other sites have neither. The page has a host name of its own, which
    browsers take for this machine and another site: they send its cookie to no other server here.
    Requests by another name, or from another site's page, are refused in any case.

    Attributes:
        host: Name and port by which the page is asked for.
        address: The page, with the token.
    """

    def __init__(self, port: int) -> None:
        self._token = secrets.token_urlsafe(32)
        self.host = f"{secrets.token_hex(8)}.localhost:{port}"
        self.address = f"http://{self.host}/?token={self._token}"

    def before(self, process: _Process) -> _Process:
        """``process``, for requests that are let in."""

        def checked(connection: Any, request: Request) -> Response | None:
            path, _, query = request.path.partition("?")
            tokens = parse_qs(query).get("token", [])
            if not self._admits(request, tokens) or path == "/drop":
                return _refusal()
            response = process(connection, request)
            if tokens and response is not None:
                response.headers["Set-Cookie"] = (
                    f"{_COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
                )
                response.headers["Referrer-Policy"] = "no-referrer"
            return response

        return checked

    def _admits(self, request: Request, tokens: list[str]) -> bool:
        headers = request.headers
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if hosts != [self.host] or any(origin != f"http://{self.host}" for origin in origins):
            return False
        cookies = [c.strip() for line in headers.get_all("Cookie") for c in line.split(";")]
        known = [c.removeprefix(f"{_COOKIE}=") for c in cookies if c.startswith(f"{_COOKIE}=")]
        given = tokens or known
        return any(secrets.compare_digest(t.encode(), self._token.encode()) for t in given)


def _kept_from_others(process: _Answer) -> _Answer:
    """``process``, whose answers no other page may show or load."""

    def checked(connection: Any, request: Request, response: Response) -> Response:
        response = process(connection, request, response) or response
        for name in (_LETS_IN_ALL, *_FOR_ITS_PAGE):
            if name in response.headers:  # assigning would add a line
                del response.headers[name]
        for name, value in _FOR_ITS_PAGE.items():
            response.headers[name] = value
        return response

    return checked


def _refusal() -> Response:
    body = b"forbidden: open the address that the program printed\n"
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body))})
    return Response(HTTPStatus.FORBIDDEN, HTTPStatus.FORBIDDEN.phrase, headers, body)


class _GatedSocket(socket.socket):
    """A listening socket with its gate."""

    gate: Gate


_serve = web_server.serve


def _serve_gated(
    *arguments: Any,
    sock: socket.socket,
    process_request: _Process,
    process_response: _Answer,
    **options: Any,
) -> Any:
    if isinstance(sock, _GatedSocket):
        process_request = sock.gate.before(process_request)
        process_response = _kept_from_others(process_response)
    options |= {"process_request": process_request, "process_response": process_response}
    return _serve(*arguments, sock=sock, **options)


# Studio has no place for it. Whether it works is tried out before a viewer is used.
web_server.serve = _serve_gated


class LoopbackViewer(web_viewer.WebViewer):  # type: ignore[misc]
    """Studio's web viewer, for this machine alone.

    Studio listens on every interface, asks for no password and loads models that are
    dropped on the page.

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
        host, port = bound.getsockname()[:2]
        if host != LOOPBACK:
            bound.close()
            raise OSError(f"MuJoCo Studio would listen on {host} instead of {LOOPBACK}")
        gated = _GatedSocket(fileno=bound.detach())
        self.gate = gated.gate = Gate(port)
        gated.listen()  # a browser that comes before the server is up waits
        self._checked_socket = gated

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
        address: Where the page is; whoever has it can open it.
    """

    def __init__(self, model: Any) -> None:
        """Start the server, at the first free port from 8080.

        Args:
            model: The model to show.

        Raises:
            OSError: If the server does not come up, or would let anybody in.
        """
        super().__init__(model)
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
        self.address = outcome.gate.address
        try:
            _check(outcome.gate)
        except OSError:
            self.close()
            raise
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


def _check(gate: Gate) -> None:
    """See that a request without the token is refused, and its answer kept from other pages.

    Raises:
        OSError: If it is not, or nobody answers.
    """
    port = int(gate.host.partition(":")[2])
    connection = http.client.HTTPConnection(LOOPBACK, port, _PATIENCE)
    with contextlib.closing(connection):
        connection.request("GET", "/", headers={"Host": gate.host})
        answer = connection.getresponse()
    if answer.status != HTTPStatus.FORBIDDEN:
        raise OSError("MuJoCo Studio would show the jump to anybody on this machine")
    if any(answer.headers.get_all(name) != [value] for name, value in _FOR_ITS_PAGE.items()):
        raise OSError("MuJoCo Studio would show the jump to pages of other sites")
