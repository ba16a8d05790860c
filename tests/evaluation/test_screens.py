"""The screens: a stage of their own, a page for this machine alone, a window on a display."""

import contextlib
import io
import signal
import sys
import types
import warnings

import mujoco
import numpy as np
import pytest
from rich.console import Console
from shows import SHORT, ScriptedScreen

from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.evaluation.modes import view
from icub_jump_env.simulation.opengl import has_display
from icub_jump_env.simulation.viewers import window
from icub_jump_env.simulation.viewers.screen import Command, Stage
from icub_jump_env.simulation.viewers.window import WindowScreen, check_window

# Stage


def test_a_stage_is_a_copy_at_the_same_state(plain_model):
    data = mujoco.MjData(plain_model)
    data.qpos[2], data.qvel[0], data.time = 0.7, 0.3, 1.5
    mujoco.mj_forward(plain_model, data)
    stage = Stage(plain_model)
    stage.take(data)
    stage.set()
    np.testing.assert_array_equal(stage.data.xpos, data.xpos)
    assert stage.data.time == 1.5

    stage.data.qpos[:] = 9.0
    stage.model.opt.gravity[:] = 0.0
    assert data.qpos[2] == 0.7
    assert plain_model.opt.gravity[2] < -9.0
    stage.set()
    np.testing.assert_array_equal(stage.data.qpos, data.qpos)


def test_the_camera_starts_where_that_of_the_videos_stands(plain_model):
    stage, camera = Stage(plain_model), mujoco.MjvCamera()
    stage.aim(camera)
    azimuth, elevation = np.radians((camera.azimuth, camera.elevation))
    ahead = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
         np.sin(elevation)]
    )  # fmt: skip
    expected = plain_model.cam_pos0[plain_model.camera("side").id]
    np.testing.assert_allclose(camera.lookat - camera.distance * ahead, expected, atol=1e-9)
    assert np.linalg.norm(camera.lookat[:2]) < 0.3


# Window


class FakeViewer:
    """Stands in for the handle of MuJoCo's viewer."""

    def __init__(self):
        self.running = True
        self.synced = 0
        self.texts = None
        self.cam = mujoco.MjvCamera()
        self.press = None

    def launch_passive(self, model, data, *, key_callback, **_):
        self.data, self.press = data, key_callback
        return self

    def is_running(self):
        return self.running

    def lock(self):
        return contextlib.nullcontext()

    def sync(self):
        self.synced += 1

    def set_texts(self, texts):
        self.texts = texts

    def close(self):
        self.running = False


@pytest.fixture
def viewer(monkeypatch):
    fake = FakeViewer()
    module = types.ModuleType("mujoco.viewer")
    module.launch_passive = fake.launch_passive
    monkeypatch.setitem(sys.modules, "mujoco.viewer", module)
    monkeypatch.setattr(mujoco, "viewer", module, raising=False)
    monkeypatch.setattr(window, "check_window", lambda: None)
    return fake


def test_the_window_shows_the_state_and_takes_keys(plain_model, viewer):
    data = mujoco.MjData(plain_model)
    data.qpos[2], data.time = 0.8, 2.0
    with contextlib.closing(WindowScreen(plain_model)) as screen:
        screen.show(data)
        assert screen.refresh({"time": "2.000 s", "phase": "flight"}) == []
        assert (viewer.data.time, viewer.data.qpos[2], viewer.synced) == (2.0, 0.8, 1)
        assert viewer.texts[2:] == ("time\nphase", "2.000 s\nflight")
        for key in (32, 262, 264, 265, 259, 65):  # the last one, A, says nothing to us
            viewer.press(key)
        assert screen.refresh({}) == [
            Command.PAUSE, Command.STEP, Command.SLOWER, Command.FASTER, Command.REPLAY,
        ]  # fmt: skip
        viewer.running = False
        assert screen.refresh({}) == [Command.QUIT]
    assert not viewer.running


def test_the_environment_shows_itself_in_such_a_window(viewer, monkeypatch):
    """In real time, and out of reach of what its user does there."""
    slept = []
    env = make_env(SHORT.replace(render_mode="human"))
    env.reset(seed=0)
    monkeypatch.setattr("time.sleep", slept.append)
    monkeypatch.setattr("time.monotonic", lambda: 7.0)  # the steps take no time
    for _ in range(3):
        env.step(np.zeros(3, np.float32))
    assert viewer.synced == 4
    assert viewer.data.time == env.data.time == pytest.approx(0.03)
    assert viewer.data is not env.data
    assert slept[-1] == pytest.approx(0.01)
    env.close()
    assert not viewer.running


def test_ctrl_c_closes_the_window_and_is_no_interrupt(viewer, monkeypatch):
    monkeypatch.setattr(FakeViewer, "sync", lambda _: signal.raise_signal(signal.SIGINT))
    monkeypatch.setattr(view, "in_browser", lambda: False)
    previous = signal.getsignal(signal.SIGINT)
    out = io.StringIO()
    view.view(SHORT, 0, Console(file=out))
    assert signal.getsignal(signal.SIGINT) is previous
    assert not viewer.running
    assert "Space: play or pause" in out.getvalue()


def test_the_meshes_are_shown_and_no_picture_is_rendered(viewer, monkeypatch):
    models = []

    def refuse(*_):
        raise AssertionError("nothing is to be rendered")

    def remember(model, *_):
        models.append(model)
        return ScriptedScreen(lambda _: [Command.QUIT])

    monkeypatch.setattr("icub_jump_env.simulation.rendering.open_context", refuse)
    monkeypatch.setattr(view, "open_screen", remember)
    view.view(SHORT, 0, Console(file=io.StringIO()))
    assert models[0].nmesh > 0


def test_without_a_display_it_is_the_browser(monkeypatch):
    monkeypatch.setattr(window, "has_display", lambda: False)
    assert view.in_browser()
    with pytest.raises(MissingDependencyError, match=r"no window .* in the browser"):
        WindowScreen(None)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only there it is tried out")
def test_without_a_reachable_display_it_is_the_browser(monkeypatch):
    """MuJoCo's viewer would wait for ever."""
    monkeypatch.setattr(window, "has_display", lambda: True)
    failing = types.SimpleNamespace(init=lambda: warnings.warn("no display", stacklevel=1))
    monkeypatch.setitem(sys.modules, "glfw", failing)
    assert view.in_browser()
    with pytest.raises(MissingDependencyError, match="no window"):
        check_window()


@pytest.mark.skipif(not has_display(), reason="needs a display")
def test_a_real_window_opens_and_closes(plain_model):
    check_window()
    with contextlib.closing(WindowScreen(plain_model)) as screen:
        screen.show(mujoco.MjData(plain_model))
        assert screen.refresh({"time": "0.000 s"}) == []
    assert screen.refresh({}) == [Command.QUIT]
