"""The screens: a stage of their own, a page for this machine alone, a window on a display."""

import contextlib
import gc
import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
import types
import urllib.error
import urllib.parse
import urllib.request
import warnings

import mujoco
import numpy as np
import psutil
import pytest
from conftest import jump
from rich.console import Console
from shows import SHORT, Clock, ScriptedScreen

from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.episodes.rollout import make_env, traced
from icub_jump_env.evaluation.modes import view
from icub_jump_env.evaluation.modes.view import Playback, Show
from icub_jump_env.simulation.opengl import has_display
from icub_jump_env.simulation.viewers import window
from icub_jump_env.simulation.viewers.screen import Command, CommandQueue, Stage
from icub_jump_env.simulation.viewers.window import WindowScreen, check_window

PATIENCE = 120.0


@pytest.fixture(scope="module")
def model():
    """Without meshes, which take their time."""
    env = make_env(SHORT)
    yield env.model
    env.close()


# Stage


def test_a_stage_is_a_copy_at_the_same_state(model):
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[0], data.time = 0.7, 0.3, 1.5
    mujoco.mj_forward(model, data)
    stage = Stage(model)
    stage.take(data)
    stage.set()
    np.testing.assert_array_equal(stage.data.xpos, data.xpos)
    assert stage.data.time == 1.5

    stage.data.qpos[:] = 9.0
    stage.model.opt.gravity[:] = 0.0
    assert data.qpos[2] == 0.7
    assert model.opt.gravity[2] < -9.0
    stage.set()
    np.testing.assert_array_equal(stage.data.qpos, data.qpos)


def test_the_camera_starts_where_that_of_the_videos_stands(model):
    stage, camera = Stage(model), mujoco.MjvCamera()
    stage.aim(camera)
    azimuth, elevation = np.radians((camera.azimuth, camera.elevation))
    ahead = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
         np.sin(elevation)]
    )  # fmt: skip
    expected = model.cam_pos0[model.camera("side").id]
    np.testing.assert_allclose(camera.lookat - camera.distance * ahead, expected, atol=1e-9)
    assert np.linalg.norm(camera.lookat[:2]) < 0.3


# Browser


def listeners():
    """Addresses that this process listens on."""
    connections = psutil.Process().net_connections(kind="inet")
    return {(c.laddr.ip, c.laddr.port) for c in connections if c.status == psutil.CONN_LISTEN}


def get(address, *files, headers=()):
    """Status and content of a page, or of files that it asks for with its cookie."""
    cookies = urllib.request.HTTPCookieProcessor()
    opener = urllib.request.build_opener(cookies)
    answers = []
    for url in (address, *(urllib.parse.urljoin(address, file) for file in files)):
        request = urllib.request.Request(url, headers=dict(headers))
        try:
            with opener.open(request, timeout=PATIENCE) as answer:
                answers.append((answer.status, answer.read()))
        except urllib.error.HTTPError as refusal:
            with refusal:
                answers.append((refusal.status, refusal.read()))
    return answers if files else answers[0]


serves = pytest.mark.filterwarnings("ignore::ResourceWarning")
"""Studio leaves its connections to the garbage collector."""


@pytest.fixture
def browser_screen():
    """Studio crashes where a viewer meets native threads of an earlier one: wait for their end."""
    kind = pytest.importorskip("icub_jump_env.simulation.viewers.browser").BrowserScreen
    threads = psutil.Process().num_threads()

    class LoneScreen(kind):
        def close(self):
            super().close()
            gc.collect()
            deadline = time.monotonic() + PATIENCE
            while psutil.Process().num_threads() > threads and time.monotonic() < deadline:
                time.sleep(0.01)

    return LoneScreen


@serves
def test_the_page_is_served_to_this_machine_alone(model, browser_screen, capsys):
    before = listeners()
    with contextlib.closing(browser_screen(model)) as screen:
        opened = listeners() - before
        url = urllib.parse.urlsplit(screen.address)
        assert (url.scheme, url.hostname, url.path) == ("http", "127.0.0.1", "/")
        assert ("127.0.0.1", url.port) in opened
        assert {ip for ip, _ in opened} == {"127.0.0.1"}
        files = ("web_client.js", "web_client.wasm", "model?total_bytes")
        page, *programs, size = get(screen.address, *files)
        assert page[0] == 200
        assert b"<canvas" in page[1]
        for status, content in programs:
            assert status == 200
            assert len(content) > 100_000
        assert json.loads(size[1])["total_bytes"] > 10_000
        assert screen.refresh({"time": "0.000 s"}) == []
    assert listeners() == before
    assert capsys.readouterr().out == ""


@serves
def test_it_can_be_opened_again(model, browser_screen):
    """Studio crashes where a viewer meets the remains of another."""
    for _ in range(2):
        with contextlib.closing(browser_screen(model)) as screen:
            assert get(screen.address)[0] == 200
            assert screen.refresh({}) == []


@serves
def test_it_does_not_start_where_others_could_connect(model, browser_screen, monkeypatch):
    """As if a future Studio chose its address in another way."""
    from icub_jump_env.simulation.viewers.browser import LoopbackViewer

    before = listeners()
    monkeypatch.setattr(LoopbackViewer, "_host", None)
    with pytest.raises(OSError, match=r"would listen on (::|0\.0\.0\.0) "):
        browser_screen(model)
    assert listeners() == before


@serves
def test_the_page_is_shown_to_those_who_have_its_address(model, browser_screen):
    with contextlib.closing(browser_screen(model)) as screen:
        url = urllib.parse.urlsplit(screen.address)
        page = f"http://{url.netloc}/"
        token = urllib.parse.parse_qs(url.query)["token"][0]
        assert len(token) >= 32
        for refused in (page, f"{page}?token=", f"{page}?token={token[:-1]}", f"{page}?token=ä"):
            assert get(urllib.parse.quote(refused, "/:?="))[0] == 403
        for file in ("web_client.js", "model", "favicon.ico", "assets/ibl.ktx"):
            assert get(page + file)[0] == 403
        cookies = {"Cookie": f"icub_jump_{url.port}={token}"}
        assert get(page, headers=cookies)[0] == 200
        assert get(page, headers={"Cookie": f'strange="; a=b; {cookies["Cookie"]}'})[0] == 200
        for wrong in (f"icub_jump_{url.port}={token}x", f"icub_jump_{url.port}", f"a={token}"):
            assert get(page, headers={"Cookie": wrong})[0] == 403
        for headers, status in (
            ({"Host": f"localhost:{url.port}"}, 200),
            ({"Host": "rebound.example"}, 403),
            ({"Host": f"rebound.example:{url.port}"}, 403),
            ({"Host": "127.0.0.1"}, 403),
            ({"Origin": f"http://{url.netloc}"}, 200),
            ({"Origin": "http://evil.example"}, 403),
            ({"Origin": f"http://127.0.0.1:{url.port + 1}"}, 403),
            ({"Origin": "null"}, 403),
        ):
            assert get(screen.address, headers=headers)[0] == status
    with contextlib.closing(browser_screen(model)) as another:
        assert token not in another.address


@serves
def test_streams_are_for_the_page_alone_and_uploads_for_nobody(model, browser_screen):
    client = pytest.importorskip("websockets.sync.client")
    refusal = pytest.importorskip("websockets.exceptions").InvalidStatus
    with contextlib.closing(browser_screen(model)) as screen:
        url = urllib.parse.urlsplit(screen.address)
        stream = f"ws://{url.netloc}"
        cookie = {"Cookie": f"icub_jump_{url.port}={url.query.removeprefix('token=')}"}

        def connect(path, headers, origin=None):
            return client.connect(
                stream + path, additional_headers=headers, origin=origin,
                proxy=None, open_timeout=PATIENCE,
            )  # fmt: skip

        screen.refresh({})
        with connect("/state?sid=a", cookie, f"http://{url.netloc}") as state:
            messages = [state.recv(PATIENCE) for _ in range(3)]
            assert any(str(message).startswith("viewers=1;") for message in messages)
        for path in ("/state", "/ui", "/drop"):
            for headers, origin in (({}, None), (cookie, "http://evil.example")):
                with pytest.raises(refusal) as error:
                    connect(path, headers, origin)
                assert error.value.response.status_code == 403
        with pytest.raises(refusal) as error:
            connect("/drop?sid=a", cookie, f"http://{url.netloc}")
        assert error.value.response.status_code == 403


@serves
def test_it_does_not_serve_without_its_gate(model, browser_screen, monkeypatch):
    """As if a future Studio served in another way."""
    from icub_jump_env.simulation.viewers import browser

    before = listeners()
    monkeypatch.setattr(browser.web_server, "serve", browser._serve)
    with pytest.raises(OSError, match="show the jump to anybody"):
        browser_screen(model)
    assert listeners() == before


@serves
def test_the_episode_in_the_browser_is_that_of_run_episode(browser_screen):
    clock, env = Clock(), make_env(traced(SHORT))
    with contextlib.closing(browser_screen(env.model)) as screen:
        refresh = screen.refresh

        def refresh_until_the_end(caption):
            return refresh(caption) + [Command.QUIT] * (caption["phase"] == "stood")

        screen.refresh = refresh_until_the_end
        pace, never = Playback(clock=clock), threading.Event()
        episode = Show(env, 0, screen, pace, never, clock, clock.sleep).run()
    env.close()
    assert episode == jump(stand_time=SHORT.success.stand_time)


def test_every_button_and_key_of_the_page_has_its_command(monkeypatch):
    view_browser = pytest.importorskip("icub_jump_env.simulation.viewers.browser")
    real, pressed, written = view_browser.imgui, set(), []
    fake = types.SimpleNamespace(
        Key=real.Key, Cond=real.Cond, WindowFlags=real.WindowFlags, Vec2=real.Vec2,
        SetNextWindowPos=lambda *_: None, Begin=lambda *_, **__: None, End=lambda: None,
        SameLine=lambda: None, NewLine=lambda: None, TextUnformatted=written.append,
        IsKeyPressed=lambda key, repeat: key in pressed, Button=lambda label: label in pressed,
    )  # fmt: skip
    monkeypatch.setattr(view_browser, "imgui", fake)
    commands = CommandQueue()
    panel = view_browser.Panel(commands)
    panel.caption = {"time": "0.100 s", "phase": "launch"}
    keys = real.Key
    for one, command in {
        keys.Space: Command.PAUSE,
        keys.RightArrow: Command.STEP,
        keys.DownArrow: Command.SLOWER,
        keys.UpArrow: Command.FASTER,
        keys.Backspace: Command.REPLAY,
        "Play / pause": Command.PAUSE,
        "Step": Command.STEP,
        "Slower": Command.SLOWER,
        "Faster": Command.FASTER,
        "Replay": Command.REPLAY,
        "Quit": Command.QUIT,
    }.items():
        pressed = {one}
        panel.build(None)
        assert commands.take() == [command]
    assert written[:2] == ["time: 0.100 s", "phase: launch"]


def test_a_missing_studio_names_the_remedy(model, monkeypatch):
    monkeypatch.delitem(sys.modules, "icub_jump_env.simulation.viewers.browser", raising=False)
    monkeypatch.setitem(sys.modules, "mujoco.studio", None)
    with pytest.raises(MissingDependencyError, match=r"MuJoCo Studio .* pip install mujoco"):
        view.open_screen(model, True, Console(file=io.StringIO()))


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a child alone")
def test_ctrl_c_ends_the_show_without_a_complaint():
    pytest.importorskip("icub_jump_env.simulation.viewers.browser")
    program = (
        "from rich.console import Console\n"
        "from icub_jump_env.config import JumpConfig\n"
        "from icub_jump_env.evaluation.modes import view\n"
        "view.in_browser = lambda: True\n"
        "view.view(JumpConfig(), 0, Console())\n"
        "print('ended')\n"
    )
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            address, keys = process.stdout.readline(), process.stdout.readline()
            assert get(address.split()[1])[0] == 200
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert "Backspace: replay" in keys
    assert (process.returncode, out, err) == (0, "ended\n", "")


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


def test_the_window_shows_the_state_and_takes_keys(model, viewer):
    data = mujoco.MjData(model)
    data.qpos[2], data.time = 0.8, 2.0
    with contextlib.closing(WindowScreen(model)) as screen:
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
    monkeypatch.setattr("time.sleep", slept.append)
    env = make_env(SHORT.replace(render_mode="human"))
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.zeros(3, np.float32))
    assert viewer.synced == 4
    assert viewer.data.time == env.data.time == pytest.approx(0.03)
    assert viewer.data is not env.data
    assert 0.0 < slept[-1] <= 0.01
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
def test_a_real_window_opens_and_closes(model):
    check_window()
    with contextlib.closing(WindowScreen(model)) as screen:
        screen.show(mujoco.MjData(model))
        assert screen.refresh({"time": "0.000 s"}) == []
    assert screen.refresh({}) == [Command.QUIT]
