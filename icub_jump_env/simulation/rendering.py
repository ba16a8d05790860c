"""Pictures of the simulation."""

from __future__ import annotations

import time
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.robot.mujoco_model import CAMERA
from icub_jump_env.simulation.opengl import open_context
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.render_config import RenderConfig
from icub_jump_env.simulation.viewers.window import WindowScreen

MAX_GEOMS = 1000


class Renderer(Protocol):
    """Shows the present state of a physics."""

    def render(self) -> NDArray[np.uint8] | None:
        """Show the present state; a (height, width, 3) picture or None."""
        ...

    def close(self) -> None:
        """Free window and graphics memory."""
        ...


def make_renderer(physics: Physics, config: RenderConfig) -> Renderer | None:
    """A renderer, if pictures are asked for.

    Raises:
        MissingDependencyError: If there is no OpenGL, or no display for a window.
    """
    if config.mode is None:
        return None
    if config.mode == "human":
        return WindowRenderer(physics)
    return PictureRenderer(physics, config.width, config.height, config.camera)


class PictureRenderer:
    """Renders off screen; opens its graphics context with the first picture."""

    def __init__(
        self, physics: Physics, width: int = 640, height: int = 480, camera: str = CAMERA
    ) -> None:
        self._model, self._data = physics.model, physics.data
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._scene = mujoco.MjvScene(self._model, MAX_GEOMS)
        self._options = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = self._model.camera(camera).id
        self._opengl: Any = None
        self._graphics: Any = None

    def render(self) -> NDArray[np.uint8]:
        """A picture of the present state, (height, width, 3)."""
        if self._opengl is None:
            self._open()
        self._opengl.make_current()
        mujoco.mjv_updateScene(
            self._model, self._data, self._options, None, self._camera,
            mujoco.mjtCatBit.mjCAT_ALL, self._scene,
        )  # fmt: skip
        mujoco.mjr_render(self._viewport, self._scene, self._graphics)
        picture = np.empty((self._viewport.height, self._viewport.width, 3), np.uint8)
        mujoco.mjr_readPixels(picture, None, self._viewport, self._graphics)
        return np.flipud(picture).copy()  # OpenGL starts at the bottom

    def _open(self) -> None:
        self._opengl = open_context(self._viewport.width, self._viewport.height)
        self._graphics = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._graphics)

    def close(self) -> None:
        """Free the graphics context."""
        if self._opengl is not None:
            self._opengl.make_current()
            self._graphics.free()
            self._opengl.free()
            self._opengl = self._graphics = None


class WindowRenderer:
    """Shows the state in a window, at most as fast as real time."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        self._screen: WindowScreen | None = None
        self._shown = 0.0, 0.0

    def render(self) -> None:
        """Bring the window up to date when it is time."""
        data = self._physics.data
        if self._screen is None:
            self._screen = WindowScreen(self._physics.model)
        now = time.monotonic()
        last_simulated, last_shown = self._shown
        time.sleep(max(0.0, min(data.time - last_simulated, 1.0) - (now - last_shown)))
        self._screen.show(data)
        self._screen.refresh({})
        self._shown = data.time, time.monotonic()

    def close(self) -> None:
        """Close the window."""
        if self._screen is not None:
            self._screen.close()
            self._screen = None
