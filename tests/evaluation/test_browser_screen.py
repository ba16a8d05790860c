"""The live view in a browser: for who knows its address alone, and the same episode."""

import contextlib
import http.server
import importlib
import io
import json
import multiprocessing
import re
import socket
import sys
import threading
import types
import urllib.error
import urllib.parse
import urllib.request

import psutil
import pytest
from conftest import jump
from rich.console import Console
from shows import PATIENCE, SHORT, Clock, get

from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.episodes.rollout import make_env, traced
from icub_jump_env.evaluation.modes import view
from icub_jump_env.evaluation.modes.view import Playback, Show
from icub_jump_env.simulation.viewers.screen import Command, CommandQueue
from icub_jump_env.workers import WorkerError

BROWSER = "icub_jump_env.simulation.viewers.browser"


def careless_pages():
    """Only where Studio can be imported."""
    return importlib.import_module("careless_pages")


def listeners(screen):
    """Addresses that the process with the page listens on."""
    connections = psutil.Process(screen.server.process.pid).net_connections(kind="inet")
    return {(c.laddr.ip, c.laddr.port) for c in connections if c.status == psutil.CONN_LISTEN}


@pytest.fixture
def browser_screen():
    return pytest.importorskip("icub_jump_env.simulation.viewers.browser").BrowserScreen


def test_the_page_is_served_to_this_machine_alone(plain_model, browser_screen, capfd):
    with contextlib.closing(browser_screen(plain_model)) as screen:
        opened = listeners(screen)
        url = urllib.parse.urlsplit(screen.address)
        assert (url.scheme, url.path) == ("http", "/")
        assert re.fullmatch(r"[0-9a-f]{16}\.localhost", url.hostname)
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
    assert not screen.server.process.is_alive()
    assert capfd.readouterr().out == ""


def test_several_can_be_open_at_a_time(plain_model, browser_screen):
    with (
        contextlib.closing(browser_screen(plain_model)) as one,
        contextlib.closing(browser_screen(plain_model)) as another,
    ):
        assert one.address != another.address
        for screen in (one, another):
            assert get(screen.address)[0] == 200
            assert screen.refresh({}) == []


@pytest.mark.fault("foreign pages")
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere an address is taken once")
@pytest.mark.parametrize("taken", ["with_its_port_taken", "with_its_name_taken"])
def test_a_port_that_another_program_has_is_left_to_it(
    plain_model, browser_screen, monkeypatch, taken
):
    """Also of IPv6, where browsers would ask first."""
    monkeypatch.setattr(f"{BROWSER}.Page", getattr(careless_pages(), taken))
    with contextlib.closing(browser_screen(plain_model)) as screen:
        url = urllib.parse.urlsplit(screen.address)
        assert not 8080 <= url.port < 8090
        assert get(screen.address)[0] == 200
        with socket.socket(socket.AF_INET6) as late, pytest.raises(OSError, match="in use"):
            late.bind(("::1", url.port))


@pytest.mark.parametrize(
    ("page", "says"),
    [
        ("listening_everywhere", r"would listen on (::|0\.0\.0\.0) "),
        ("shown_to_anybody", "to anybody on this machine"),
        ("shown_to_other_sites", "to pages of other sites"),
    ],
)
def test_it_does_not_start_where_others_could_connect(
    plain_model, browser_screen, monkeypatch, page, says
):
    monkeypatch.setattr(f"{BROWSER}.Page", getattr(careless_pages(), page))
    with pytest.raises(WorkerError, match=says):
        browser_screen(plain_model)
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize(
    ("page", "says"),
    [
        ("AbortingPage", r"the live view died \(exit code -6\)"),
        ("FailingPage", "the live view failed: ValueError: no paint left"),
        ("HangingPage", "the live view failed: ValueError: no paint left"),
    ],
)
def test_a_crash_of_studio_is_an_error_here(plain_model, browser_screen, monkeypatch, page, says):
    monkeypatch.setattr(f"{BROWSER}.Page", getattr(careless_pages(), page))
    with (
        contextlib.closing(browser_screen(plain_model)) as screen,
        pytest.raises(WorkerError, match=says),
    ):
        screen.refresh({})


@pytest.mark.fault("foreign pages")
def test_the_page_is_shown_to_those_who_have_its_address(plain_model, browser_screen):
    with contextlib.closing(browser_screen(plain_model)) as screen:
        url = urllib.parse.urlsplit(screen.address)
        page = f"http://{url.netloc}/"
        token = urllib.parse.parse_qs(url.query)["token"][0]
        assert len(token) >= 32
        for refused in (page, f"{page}?token=", f"{page}?token={token[:-1]}", f"{page}?token=ä"):
            assert get(urllib.parse.quote(refused, "/:?="))[0] == 403
        for file in ("web_client.js", "model", "favicon.ico", "assets/ibl.ktx"):
            assert get(page + file)[0] == 403
        cookies = {"Cookie": f"icub_jump={token}"}
        assert get(page, headers=cookies)[0] == 200
        assert get(page, headers={"Cookie": f'strange="; a=b; {cookies["Cookie"]}'})[0] == 200
        for wrong in (f"icub_jump={token}x", "icub_jump", f"a={token}"):
            assert get(page, headers={"Cookie": wrong})[0] == 403
        for headers, status in (
            ({"Host": f"localhost:{url.port}"}, 403),
            ({"Host": f"127.0.0.1:{url.port}"}, 403),
            ({"Host": f"{16 * '0'}.localhost:{url.port}"}, 403),
            ({"Host": "rebound.example"}, 403),
            ({"Host": f"rebound.example:{url.port}"}, 403),
            ({"Host": url.hostname}, 403),
            ({"Origin": f"http://{url.netloc}"}, 200),
            ({"Origin": "http://evil.example"}, 403),
            ({"Origin": f"http://127.0.0.1:{url.port + 1}"}, 403),
            ({"Origin": "null"}, 403),
        ):
            assert get(screen.address, headers=headers)[0] == status
    with contextlib.closing(browser_screen(plain_model)) as another:
        assert token not in another.address


@pytest.mark.fault("foreign pages")
def test_streams_are_for_the_page_alone_and_uploads_for_nobody(plain_model, browser_screen):
    client = pytest.importorskip("websockets.sync.client")
    refusal = pytest.importorskip("websockets.exceptions").InvalidStatus
    with contextlib.closing(browser_screen(plain_model)) as screen:
        url = urllib.parse.urlsplit(screen.address)
        cookie = {"Cookie": f"icub_jump={url.query.removeprefix('token=')}"}

        def connect(path, headers, origin=None):
            return client.connect(
                f"ws://{url.netloc}{path}", additional_headers=headers, origin=origin,
                sock=socket.create_connection(("127.0.0.1", url.port)), open_timeout=PATIENCE,
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


FOREIGN_PAGE = """<script>
const there = "%s", found = {};
const tell = (name, what) => { found[name] = what; };
const tries = [
  fetch(there).then((answer) => tell("fetch", answer.status), () => tell("fetch", "refused")),
  fetch(there, {credentials: "include"}).then((answer) => tell("cookie", answer.status), () => tell("cookie", "refused")),
  fetch(there, {mode: "no-cors", credentials: "include"})
    .then(() => tell("blind", "loaded"), () => tell("blind", "refused")),
  new Promise((done) => {
    const stream = new WebSocket(there.replace("http", "ws") + "state?sid=a");
    stream.onopen = () => done(tell("stream", "open"));
    stream.onerror = () => done(tell("stream", "refused"));
  }),
  new Promise((done) => {
    const frame = document.createElement("iframe");
    frame.src = there;
    frame.onload = () => done(tell("frame", frame.contentDocument === null ? "other" : "empty"));
    document.documentElement.append(frame);
  }),
];
Promise.all(tries).then(() => { document.title = JSON.stringify(found); });
</script>"""


@pytest.mark.fault("foreign pages")
def test_a_foreign_page_gets_nothing(plain_model, browser_screen, browser, tmp_path):
    from selenium.webdriver.support.wait import WebDriverWait

    received = []

    class Foreign(http.server.SimpleHTTPRequestHandler):
        def do_GET(self):
            received.append(self.headers.get("Cookie", ""))
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(page.encode())

        def log_message(self, *_):
            pass

    with (
        contextlib.closing(browser_screen(plain_model)) as screen,
        http.server.ThreadingHTTPServer(("127.0.0.1", 0), Foreign) as server,
    ):
        url = urllib.parse.urlsplit(screen.address)
        page = FOREIGN_PAGE % f"http://{url.netloc}/"
        threading.Thread(target=server.serve_forever).start()
        try:
            browser.get(screen.address)  # from now on it has the cookie
            assert browser.find_elements("tag name", "canvas")
            browser.get(f"http://127.0.0.1:{server.server_port}/")
            WebDriverWait(browser, PATIENCE).until(lambda _: browser.title.startswith("{"))
        finally:
            server.shutdown()
        frame = browser.find_element("tag name", "iframe")
        browser.switch_to.frame(frame)
        shown = browser.execute_script(
            "return [location.protocol, document.querySelectorAll('canvas').length]"
        )
        browser.switch_to.default_content()
        browser.get_log("browser")  # what was refused, which is no matter of later tests
    assert json.loads(browser.title) == {
        "fetch": "refused",
        "cookie": "refused",
        "blind": "refused",
        "stream": "refused",
        "frame": "other",
    }
    assert shown == ["chrome-error:", 0]
    assert set(received) == {""}


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
    page = pytest.importorskip("icub_jump_env.simulation.viewers.page")
    real, pressed, written = page.imgui, set(), []
    fake = types.SimpleNamespace(
        Key=real.Key, Cond=real.Cond, WindowFlags=real.WindowFlags, Vec2=real.Vec2,
        SetNextWindowPos=lambda *_: None, Begin=lambda *_, **__: None, End=lambda: None,
        SameLine=lambda: None, NewLine=lambda: None, TextUnformatted=written.append,
        IsKeyPressed=lambda key, repeat: key in pressed, Button=lambda label: label in pressed,
    )  # fmt: skip
    monkeypatch.setattr(page, "imgui", fake)
    commands = CommandQueue()
    panel = page.Panel(commands)
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


def test_a_missing_studio_names_the_remedy(plain_model, monkeypatch):
    for module in ("browser", "page"):
        name = f"icub_jump_env.simulation.viewers.{module}"
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "mujoco.studio", None)
    with pytest.raises(MissingDependencyError, match=r"MuJoCo Studio .* pip install mujoco"):
        view.open_screen(plain_model, True, Console(file=io.StringIO()))
