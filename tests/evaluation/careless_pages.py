"""Pages as if a future Studio served in another way; importable in workers."""

import contextlib
import functools
import os
import socket
import threading

from icub_jump_env.simulation.viewers import page
from icub_jump_env.simulation.viewers.page import LoopbackViewer, Page


def listening_everywhere():
    LoopbackViewer._host = None
    return Page()


def shown_to_anybody():
    page.web_server.serve = page._serve
    return Page()


def shown_to_other_sites():
    page.kept_from_others = lambda handler: handler
    return Page()


class AbortingPage(Page):
    def show(self, state, caption):
        os.abort()


class FailingPage(Page):
    def show(self, state, caption):
        raise ValueError("no paint left")


class HangingPage(FailingPage):
    """Whose viewer would never end."""

    def open(self, model):
        address = super().open(model)
        self._handle.close = threading.Event().wait
        return address


def with_its_port_taken(address="127.0.0.1"):
    """Another program listens there between Studio's choice and our use of it."""
    bind = page.web_server.bind_public_socket

    def bind_too_late(*arguments):
        bound = bind(*arguments)
        rival = socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET)
        rival.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with contextlib.suppress(OSError):  # a live view of another test run has it
            rival.bind((address, bound.getsockname()[1]))
            rival.listen()
        rivals.append(rival)
        return bound

    page.web_server.bind_public_socket = bind_too_late
    return Page()


with_its_name_taken = functools.partial(with_its_port_taken, "::1")
rivals = []
