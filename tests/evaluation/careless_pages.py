"""Pages as if a future Studio served in another way; importable in workers."""

import os
import socket

from icub_jump_env.simulation.viewers import page
from icub_jump_env.simulation.viewers.page import LoopbackViewer, Page


def listening_everywhere(model):
    LoopbackViewer._host = None
    return Page(model)


def shown_to_anybody(model):
    page.web_server.serve = page._serve
    return Page(model)


def shown_to_other_sites(model):
    page.kept_from_others = lambda process: process
    return Page(model)


class AbortingPage(Page):
    def __call__(self, scene):
        if scene is not None:
            os.abort()
        return super().__call__(scene)


def with_its_port_taken(model):
    """Another program listens between Studio's choice and our use of it."""
    bind = page.web_server.bind_public_socket

    def bind_too_late(*arguments):
        bound = bind(*arguments)
        rival = socket.socket()
        rival.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        rival.bind(bound.getsockname())
        rival.listen()
        rivals.append(rival)
        return bound

    page.web_server.bind_public_socket = bind_too_late
    return Page(model)


rivals = []
