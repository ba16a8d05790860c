"""Who may see the page of the live view."""

from __future__ import annotations

import contextlib
import http.client
import secrets
from collections.abc import Callable
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

LOOPBACK = "127.0.0.1"

Handler = Callable[[Any, Request], Response | None]
"""Answers a request, or lets it pass."""

Answer = Callable[[Any, Request, Response], Response | None]
"""Changes an answer."""

_PATIENCE = 10.0
"""Longest time (s) until the server answers for the first time."""

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

    def before(self, process: Handler) -> Handler:
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


def kept_from_others(process: Answer) -> Answer:
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


def check(gate: Gate) -> None:
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
