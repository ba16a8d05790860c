"""The page of ``--report``: complete, self-contained and at home in a real browser."""

import base64
import contextlib
import dataclasses
import io
import itertools
import json
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from conftest import jump
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
from icub_jump_env.evaluation.figures.paper import WIDTH
from icub_jump_env.evaluation.figures.snapshots import (
    STRIP_WIDTH,
    Shot,
    draw_strip,
    take_snapshots,
)
from icub_jump_env.evaluation.modes import report
from icub_jump_env.evaluation.modes.video import check_video
from icub_jump_env.evaluation.statistics.paper import comparison_rows
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor

CONFIG = JumpConfig.of(stand_time=0.1, agent_frequency=10.0)  # few pictures in the videos
QUIET = Console(file=io.StringIO())
MOMENTS = ["Crouch", "Take-off", "Apex", "First impact", "Stands"]
LOADED_FROM = ("src", "href", "poster", "srcset", "data", "action", "xlink:href", "background")


@pytest.fixture(scope="session")
def pictures():
    """Skip where none can be made."""
    try:
        check_video(Path("jump.mp4"))
    except MissingDependencyError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def written(pictures, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports") / "made" / "here"
    run, shown = report.run_nominal, {}

    def remembered(config, *rest, **how):
        shown[config.controller_name] = run(config, *rest, **how)
        return shown[config.controller_name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "run_nominal", remembered)
        file = report.write_report(folder, CONFIG, 0, QUIET)
    assert list(folder.iterdir()) == [file]
    assert file.name == "index.html"
    return file, shown


@pytest.fixture(scope="session")
def page(written):
    return written[0]


@pytest.fixture(scope="session")
def arms(written):
    """What was jumped for the page, by controller."""
    return written[1]


@pytest.fixture(scope="session")
def shots(pictures):
    return take_snapshots(CONFIG, traced_episode(CONFIG))


def traced_episode(config):
    with contextlib.closing(make_env(traced(config))) as env:
        return run_episode(env, 0, trace=True)


class Reader(HTMLParser):
    """Collects elements, and the cells of each table by its controller."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.tables, self._cell = [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.elements.append((tag, attributes))
        if tag == "table":
            self.rows = self.tables.setdefault(attributes.get("data-controller"), [])
        elif tag == "tr":
            self.rows.append([])
        elif tag in ("th", "td"):
            self._cell = []

    def handle_endtag(self, tag):
        if tag in ("th", "td"):
            self.rows[-1].append(" ".join("".join(self._cell).split()))
            self._cell = None

    def handle_data(self, data):
        if self._cell is not None:
            self._cell.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="session")
def read(page):
    return Reader(page.read_text())


def outside(elements):
    """What is loaded from elsewhere than the page itself."""
    return [
        (tag, name, value[:80])
        for tag, attributes in elements
        for name, value in attributes.items()
        if name in LOADED_FROM and not value.startswith(("data:", "#"))
    ]


def test_page_loads_nothing_from_elsewhere(page, read):
    text = page.read_text()
    assert outside(read.elements) == []
    assert not {"script", "iframe", "object", "embed"} & {tag for tag, _ in read.elements}
    for style in re.findall(r"<style>(.*?)</style>", text, re.DOTALL):
        assert "url(" not in style
        assert "@import" not in style
    drawings = re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", text)
    assert len(drawings) == 6
    for drawing in drawings:
        svg = base64.b64decode(drawing).decode()
        assert outside(Reader(svg).elements) == []
        assert "prefers-color-scheme:dark" in svg
        assert set(re.findall(r"(?:fill|stroke): (#\w+)", svg)) <= {"#ffffff", "#cccccc"}
    assert 200_000 < len(text) < 4_000_000


def test_page_is_accessible(read):
    tags = [tag for tag, _ in read.elements]
    assert tags.count("h1") == 1
    assert tags.count("h2") == 5
    levels = [int(tag[1]) for tag in tags if re.fullmatch(r"h\d", tag)]
    assert all(below <= above + 1 for above, below in itertools.pairwise(levels))
    images = read.all("img")
    assert len(images) == 4 * len(MOMENTS) + 6
    assert all(len(image["alt"]) > 20 for image in images)
    assert len({image["alt"] for image in images}) == len(images)
    assert all(image["width"] and image["height"] for image in images)
    assert [video["aria-label"] for video in read.all("video")] != []
    assert read.all("html") == [{"lang": "en"}]
    names = {attributes["id"] for _, attributes in read.elements if "id" in attributes}
    assert {link["href"][1:] for link in read.all("a")} <= names


@pytest.mark.parametrize("controller", ["velocity", "torque"])
def test_table_says_what_the_jump_did(read, arms, controller):
    ours, ablated = arms[controller]
    for arm, posed in ((ours, True), (ablated, False)):
        expected = jump(controller=controller, stand_time=0.1, momentum_control=posed)
        assert arm.episode.jump == expected.jump
    head, *lines = read.tables[controller]
    assert [word.replace("\N{SOFT HYPHEN}", "") for word in head] == [
        "quantity", "paper", "ours", "10 to 90 %", "difference",
        f"no eq. {'3d' if controller == 'velocity' else '6d'}",
    ]  # fmt: skip
    rows = comparison_rows(ours.config, ours.repeated, ablated.repeated)
    assert len(lines) == len(rows)
    for row, (quantity, *cells) in zip(rows, lines, strict=True):
        assert quantity.startswith(f"{row.quantity}, {row.unit}")
        paper, middle, spread, difference, other = cells
        low, _, high = spread.partition(" to ")
        for value, cell in zip(
            (row.paper, row.ours, *row.spread, row.difference, row.other),
            (paper, middle, low, high or low, difference, other),
            strict=True,
        ):
            if value is None:
                assert cell == "\N{EN DASH}"
            else:
                decimals = len(cell.partition(".")[2])
                shown = float(cell.replace("\N{MINUS SIGN}", "-"))
                assert shown == pytest.approx(value, abs=0.5000001 * 10**-decimals)


def test_page_has_the_whole_configuration_and_the_versions(page, read):
    fields, versions = (dict(table[1:]) for table in np.split(_plain(read), [_break(read)]))
    assert list(fields) == [field.name for field in dataclasses.fields(JumpConfig)]
    assert fields["controller"] == "velocity and torque"
    assert fields["jump_height"] == "0.04"
    assert fields["success"] == f"{CONFIG.success} not the default"
    assert "stand_time=0.1" in fields["success"]
    assert {"icub-jump", "mujoco", "python"} <= set(versions)


def _plain(read):
    return np.array(read.tables[None], dtype=object)


def _break(read):
    return next(i for i, row in enumerate(read.tables[None]) if row == ["package", "version"])


def test_moments_are_those_of_the_metrics(shots):
    episode = jump(**dataclasses.asdict(CONFIG))
    takeoff, flight = episode.jump["takeoff_time"], episode.jump["flight_time"]
    assert [shot.name for shot in shots] == MOMENTS
    crouch, off, apex, impact, end = (shot.time for shot in shots)
    tick = CONFIG.control_dt
    assert crouch == 0.0
    assert 0.0 <= off - takeoff + 1e-9 < tick
    assert 0.0 <= impact - (takeoff + flight) + 1e-9 < tick
    assert apex == pytest.approx(takeoff + episode.jump["takeoff_velocity"] / 9.81, abs=2 * tick)
    assert end == pytest.approx(impact + CONFIG.success.stand_time, abs=2 * tick)


def test_pictures_show_the_robot_at_these_moments(shots):
    heights = []
    for shot in shots:
        red = (shot.close_up[..., 0] > 120) & (shot.close_up[..., 1] < 80)
        assert 0.02 < red.mean() < 0.5
        rows = np.flatnonzero(red.any(axis=1))
        assert rows[-1] < len(red) - 1, "the feet should be in the picture"
        heights.append(len(red) - rows[-1])
    crouch, off, apex, impact, end = heights
    assert apex > max(crouch, off, impact, end), "the soles should be off the floor"


def test_the_strip_fits_a_readme(shots):
    file = io.BytesIO()
    draw_strip(shots).savefig(file)
    assert len(file.getvalue()) < 400_000
    width = int.from_bytes(file.getvalue()[16:20], "big")  # of the PNG's header
    assert width == STRIP_WIDTH == 1600


def test_without_take_off_there_are_two_moments(pictures):
    weak = ActuatorConfig(motor=DCMotor(current_limit=0.3))
    config = JumpConfig.of(actuators=weak)
    names = [shot.name for shot in take_snapshots(config, traced_episode(config))]
    assert names == ["Crouch", "End"]


@pytest.fixture
def unseen(monkeypatch, pictures):
    """Pages without pictures are made at once."""
    grey = Shot("Crouch", 0.0, np.full((480, 640, 3), 128, np.uint8))
    monkeypatch.setattr(report, "take_snapshots", lambda *_: [grey])
    monkeypatch.setattr(report, "_video", lambda *_: "data:video/mp4;base64,")


def test_other_jumps_are_told_from_the_papers(unseen, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["eval.py", "--report", "<script>alert(1)</script>"])
    config = JumpConfig.of(jump_height=0.05, momentum_control=False, stand_time=1.0)
    text = report.write_report(tmp_path, config, 3, QUIET).read_text()
    read = Reader(text)
    assert read.all("script") == []
    assert "&lt;script&gt;" in text
    for controller in ("velocity", "torque"):
        head, flight, *_ = read.tables[controller]
        assert head[-1] == f"with eq. {'3d' if controller == 'velocity' else '6d'}"
        assert flight[4] == "\N{EN DASH}"
    assert "the paper’s simulation" not in text  # noqa: RUF001 (typographic)
    assert "Velocity controller with the constraint" in text
    assert "and it falls" in text
    assert "seed 3" in text


def test_an_existing_page_stays_if_the_new_one_is_not_complete(unseen, monkeypatch, tmp_path):
    (tmp_path / "index.html").write_text("old")

    def full_disk(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="no space"):
        report.write_report(tmp_path, CONFIG, 0, QUIET)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]


@pytest.fixture
def idle(monkeypatch):
    monkeypatch.setattr(report, "run_nominal", lambda *_, **__: pytest.fail("should not jump"))


def test_refuses_before_any_work_where_it_cannot_write(idle, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "taken" / "index.html").mkdir(parents=True)
    for folder in ("file", "taken"):
        with pytest.raises(ConfigError, match=f"report=.*{folder}"):
            report.write_report(tmp_path / folder, CONFIG, 0, QUIET)


def test_refuses_before_any_work_without_the_extra(idle, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "imageio.v3", None)
    with pytest.raises(MissingDependencyError, match="extra 'video'"):
        report.write_report(tmp_path / "new", CONFIG, 0, QUIET)
    assert not (tmp_path / "new").exists()


def test_refuses_before_any_work_what_one_controller_cannot_do(idle, pictures, tmp_path):
    only_torque = JumpConfig.of(controller="torque", agent_frequency=500.0)
    with pytest.raises(ConfigError, match="agent_frequency"):
        report.write_report(tmp_path, only_torque, 0, QUIET)


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_browser_shows_the_page(browser, page, width, scheme):
    from selenium.webdriver.support.wait import WebDriverWait

    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": False},
    )
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia",
        {"features": [{"name": "prefers-color-scheme", "value": scheme}]},
    )
    browser.get_log("performance")
    browser.get(page.as_uri())
    script = browser.execute_script
    WebDriverWait(browser, 20).until(
        lambda _: script("return [...document.querySelectorAll('video')].every(v => v.readyState)")
    )
    assert script("return [...document.querySelectorAll('video')].map(v => v.error)") == [None] * 2
    assert min(script("return [...document.querySelectorAll('video')].map(v => v.duration)")) > 2.0
    assert script("return innerWidth") == width
    assert script("return document.documentElement.scrollWidth") <= width
    assert script("return [...document.images].filter(i => !i.naturalWidth).length") == 0
    drawings = "[...document.querySelectorAll('.drawing img')].map(i => i.getBoundingClientRect())"
    assert script(f"return {drawings}.filter(b => b.left < 0 || b.right > innerWidth).length") == 0
    # Letters of 10 points are at least 8 pixels high.
    assert script(f"return Math.min(...{drawings}.map(b => b.width))") >= 0.6 * 96 * WIDTH
    headings = script("return [...document.querySelectorAll('h1, h2')].map(h => h.innerText)")
    assert len(headings) == 6
    assert all(headings)
    shade = script("return getComputedStyle(document.body).backgroundColor")
    assert (max(int(part) for part in re.findall(r"\d+", shade)) < 64) == (scheme == "dark")
    assert [entry for entry in browser.get_log("browser") if entry["level"] != "INFO"] == []
    messages = [
        json.loads(entry["message"])["message"] for entry in browser.get_log("performance")
    ]
    asked = {
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    }
    assert page.as_uri() in asked
    assert {url for url in asked if not url.startswith("data:")} == {page.as_uri()}


def test_contrast_is_that_of_wcag_aa(browser, page):
    """Each text against the nearest background that is painted behind it."""
    script = """
    const shades = text => text.match(/[\\d.]+/g).map(Number);
    const light = ([r, g, b]) => [r, g, b].map(c => c / 255).map(
        c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4
    ).reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
    const behind = e => {
        const shade = shades(getComputedStyle(e).backgroundColor);
        return shade[3] === 0 && e.parentElement ? behind(e.parentElement) : shade;
    };
    const poor = [];
    for (const e of document.body.querySelectorAll(':not(video)')) {
        if (![...e.childNodes].some(n => n.nodeType === 3 && n.data.trim())) continue;
        const [a, b] = [light(shades(getComputedStyle(e).color)), light(behind(e))];
        const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        if (contrast < 4.5) poor.push([e.outerHTML.slice(0, 80), contrast]);
    }
    return poor;
    """
    for scheme in ("light", "dark"):
        browser.execute_cdp_cmd(
            "Emulation.setEmulatedMedia",
            {"features": [{"name": "prefers-color-scheme", "value": scheme}]},
        )
        browser.get(page.as_uri())
        assert browser.execute_script(script) == []
