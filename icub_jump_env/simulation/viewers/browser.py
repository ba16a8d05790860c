"""The jump in the browser, by MuJoCo Studio's web viewer; imported where that is wanted."""

from __future__ import annotations

from typing import Any

from icub_jump_env.simulation.viewers.page import Page
from icub_jump_env.simulation.viewers.screen import Caption, Command, Screen
from icub_jump_env.workers import Worker


class BrowserScreen(Screen):
    """A page on this machine that shows the jump, in a process whose crash is not ours.

    Attributes:
        address: Where the page is; whoever has it can open it.
        server: The process that serves it.
    """

    def __init__(self, model: Any) -> None:
        """Start the server.

        Args:
            model: The model to show.

        Raises:
            WorkerError: If the server does not come up, or would let anybody in.
        """
        super().__init__(model)
        self.server = Worker("the live view", Page)
        try:
            self.server.send(self._stage.model)
            self.address: str = self.server.recv()
        except BaseException:
            self.close()
            raise

    def refresh(self, caption: Caption) -> list[Command]:
        """Bring the page up to date; returns what the user asked for.

        Raises:
            WorkerError: If the server is dead.
        """
        self.server.send((self._stage.state, caption))
        commands: list[Command] = self.server.recv()
        return commands

    def close(self) -> None:
        """End the server."""
        self.server.end()
