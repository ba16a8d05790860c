"""What every screen has: commands from its user, and a world of its own to draw."""

from __future__ import annotations

import copy
import enum
import math
import queue
from abc import ABC, abstractmethod
from typing import Any

import mujoco
import numpy as np

from icub_jump_env.robot.mujoco_model import CAMERA

Caption = dict[str, str]
"""What is written next to the picture: texts by name."""

KEYS = "Space: play or pause, Right: one step, Up/Down: faster/slower, Backspace: replay"

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class Command(enum.Enum):
    """What the user can ask for."""

    PAUSE = enum.auto()
    STEP = enum.auto()
    SLOWER = enum.auto()
    FASTER = enum.auto()
    REPLAY = enum.auto()
    QUIT = enum.auto()


class CommandQueue:
    """Carries commands from a viewer's thread to ours."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Command] = queue.SimpleQueue()

    def put(self, command: Command) -> None:
        """Add a command."""
        self._queue.put(command)

    def take(self) -> list[Command]:
        """Remove and return the commands so far."""
        return [self._queue.get() for _ in range(self._queue.qsize())]


class Stage:
    """A world of a viewer's own: what its user does there cannot touch the jump.

    Attributes:
        model: A copy of the model.
        data: Data of the copy.
        state: The remembered state of the simulation, as ``mj_getState`` gives it.
    """

    def __init__(self, model: Any) -> None:
        self.model = copy.deepcopy(model)
        self.data = mujoco.MjData(self.model)
        self.state = np.zeros(mujoco.mj_stateSize(self.model, _STATE))
        self.take(self.data)

    def take(self, data: Any) -> None:
        """Remember the present state of a simulation."""
        mujoco.mj_getState(self.model, data, self.state, _STATE)

    def set(self) -> None:
        """Put the remembered state into the data."""
        mujoco.mj_setState(self.model, self.data, self.state, _STATE)
        mujoco.mj_forward(self.model, self.data)

    def aim(self, camera: Any) -> None:
        """Let a camera that the user can move start where the videos' camera stands."""
        camera_id = self.model.camera(CAMERA).id
        position = self.model.cam_pos0[camera_id]
        ahead = -self.model.cam_mat0[camera_id].reshape(3, 3)[:, 2]
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.distance = math.hypot(position[0], position[1])
        camera.lookat[:] = position + camera.distance * ahead
        camera.azimuth = math.degrees(math.atan2(ahead[1], ahead[0]))
        camera.elevation = math.degrees(math.asin(ahead[2]))


class Screen(ABC):
    """Where the jump is shown."""

    def __init__(self, model: Any) -> None:
        """Prepare a world of its own to draw.

        Args:
            model: The model to show.
        """
        self._stage = Stage(model)

    def show(self, data: Any) -> None:
        """Show the present state of ``data`` from the next refresh on."""
        self._stage.take(data)

    @abstractmethod
    def refresh(self, caption: Caption) -> list[Command]:
        """Bring the picture up to date; returns what the user asked for."""

    @abstractmethod
    def close(self) -> None:
        """Free it."""
