"""One HTML page that shows both controllers' jumps, readable without a network."""

from __future__ import annotations

import base64
import dataclasses
import io
import shlex
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import jinja2
import matplotlib
from matplotlib.figure import Figure
from rich.console import Console

from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.evaluation.figures.paper import (
    ACCENT,
    DESIRED,
    MEASURED,
    base_pitch_figure,
    com_reference_figure,
    launch_figure,
    realistic,
    robot_figure,
)
from icub_jump_env.evaluation.modes.nominal import Arm, run_nominal
from icub_jump_env.evaluation.report.output import check_writable, progress_display
from icub_jump_env.evaluation.report.provenance import command, provenance
from icub_jump_env.evaluation.episodes.rollout import Frame, make_env, run_episode, traced
from icub_jump_env.evaluation.figures.snapshots import Shot, take_snapshots
from icub_jump_env.evaluation.quantities import Row, comparison_rows, number, verdict
from icub_jump_env.evaluation.modes.video import SLOW_MOTION, check_video, record_video
from icub_jump_env.files import write_file

PAGE = "index.html"

_INK = "#24303c"

_COLORS = {
    "ink": (_INK, _INK, "#d5dde5"),
    "measured": (MEASURED, MEASURED, "#5cb8d6"),
    "desired": (DESIRED, "#c03648", "#f4818d"),
    "accent": (ACCENT, "#5d6b82", "#97a6bd"),
}
"""Colours of the figures: as drawn, on a light page, on a dark page. Text of these colours has
a contrast of at least 4.5 to the page."""

_STYLE: dict[Any, Any] = {
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor"), _INK),
    **dict.fromkeys(("xtick.color", "ytick.color"), _INK),
    "svg.fonttype": "path",  # looks alike whatever fonts the reader has
    "svg.hashsalt": "icub-jump",  # the same jump makes the same page
}

_CONTROLLERS: tuple[ControllerName, ...] = get_args(ControllerName)

_OUTCOMES = {
    "stood": "lands and stands",
    "fell": "falls",
    "no take-off": "does not leave the ground",
    "diverged": "leaves the simulation diverging",
}


@dataclass(frozen=True)
class _Picture:
    """What an ``img`` element needs.

    Attributes:
        uri: The picture itself, as a data URI.
        width: Natural width (CSS pixels).
        height: Natural height.
        alt: What it shows, for those who cannot see it.
        caption: What is written below it.
    """

    uri: str
    width: int
    height: int
    alt: str
    caption: str = ""


@dataclass(frozen=True)
class _Moment:
    """One picture of a strip."""

    name: str
    time: float
    picture: _Picture


@dataclass(frozen=True)
class _Jump:
    """What the page shows of one controller.

    Attributes:
        controller: Its name.
        ends: How the jump ends.
        rows: The table against the paper, by quantity.
        verdict: Which arm of the ablation stands.
        video: The jump as a data URI.
        poster: The picture shown before the video runs.
        moments: The strip of the jump as configured.
        switched_moments: The same with the momentum constraint switched over.
        launch: The paper's Fig. 2 or 3.
        base_pitch: The paper's Fig. 6.
    """

    controller: ControllerName
    ends: str
    rows: dict[str, Row]
    verdict: str
    video: str
    poster: str
    moments: list[_Moment]
    switched_moments: list[_Moment]
    launch: _Picture
    base_pitch: _Picture


def check_report(folder: Path) -> None:
    """Refuse early if a report cannot be made here.

    Raises:
        ConfigError: If the folder cannot be written.
        MissingDependencyError: Naming the remedy.
    """
    check_writable("report", folder, folder=True)
    if folder.exists():
        check_writable("report", folder / PAGE)
    check_video(folder / "jump.mp4")


def write_report(folder: Path, config: JumpConfig, seed: int, console: Console) -> Path:
    """Jump with both controllers and write the page.

    Args:
        folder: Where to write ``index.html``; made if missing.
        config: The jump; its controller and render mode do not matter.
        seed: Seed of each episode.
        console: Where the progress is shown.

    Returns:
        The file written.

    Raises:
        ConfigError: If the folder cannot be written, or a controller cannot run as configured.
        MissingDependencyError: If the extra or OpenGL is missing.
    """
    check_report(folder)
    configs = [
        dataclasses.replace(config, controller=controller, render_mode=None)
        for controller in _CONTROLLERS
    ]
    robot = realistic(configs[0])
    with matplotlib.rc_context(_STYLE):
        page = _render(
            config=configs[0],
            seed=seed,
            jumps=[_jump(each, seed, console) for each in configs],
            com_reference=_com_reference(configs[0]),
            robot=_robot(robot, seed),
            fields=_fields(configs),
            versions=provenance(config, seed)["versions"],
            command=shlex.join(command()),
            slow_motion=SLOW_MOTION,
        )
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / PAGE
    write_file(file, page.encode())
    return file


def _jump(config: JumpConfig, seed: int, console: Console) -> _Jump:
    ours, switched = run_nominal(config, seed, trace=True, console=console)
    rows = comparison_rows(config, ours.episode, switched.episode)
    with progress_display(console) as progress:
        progress.add_task("taking pictures", total=None)
        shots = take_snapshots(ours.config, seed)
        switched_shots = take_snapshots(switched.config, seed)
    apex = next((shot for shot in shots if shot.name == "Apex"), shots[0])
    return _Jump(
        controller=config.controller,
        ends=_OUTCOMES[ours.episode.outcome],
        rows={row.quantity: row for row in rows},
        verdict=verdict(rows, config.momentum_control),
        video=_video(config, seed, console),
        poster=_photo(apex.picture),
        moments=_moments(ours, shots),
        switched_moments=_moments(switched, switched_shots),
        launch=_launch(ours),
        base_pitch=_base_pitch(ours, switched),
    )


def _moments(arm: Arm, shots: list[Shot]) -> list[_Moment]:
    moments = []
    for shot in shots:
        height, width, _ = shot.close_up.shape
        alt = (
            f"The iCub, {arm.config.controller} controller, {arm.name} the momentum constraint: "
            f"{shot.name.lower()} at {shot.time:.3f} s"
        )
        moments.append(
            _Moment(shot.name, shot.time, _Picture(_photo(shot.close_up), width, height, alt))
        )
    return moments


def _com_reference(config: JumpConfig) -> _Picture:
    return _drawing(
        com_reference_figure(config),
        "Two curves over the launch: the vertical CoM velocity, from zero to the take-off "
        "velocity, and the vertical CoM acceleration.",
        "Fig. 1: the vertical CoM reference that both controllers follow.",
    )


def _launch(arm: Arm) -> _Picture:
    controller = arm.config.controller
    number, quantity = {"velocity": (2, "velocities"), "torque": (3, "torques")}[controller]
    return _drawing(
        launch_figure(arm.config, arm.episode.trace),
        f"Four plots over time: the {quantity} of the left ankle, knee and hip pitch joints in "
        "the launch, desired and measured, and the CoM height, reference and true.",
        f"Fig. {number}: joint {quantity} and CoM height with the {controller} controller; "
        "dashed: desired, solid: measured. T is the commanded take-off.",
    )


def _robot(config: JumpConfig, seed: int) -> _Picture:
    env = make_env(traced(config))
    episode = run_episode(env, seed, trace=True)
    env.close()
    return _drawing(
        robot_figure(config, episode.trace),
        "Four plots over time: the velocities of the left ankle, knee and hip pitch joints in "
        "the launch, desired and measured, and the CoM height, estimated, true and reference.",
        "Fig. 4: the paper shows the real robot here; this is a simulation with the presets "
        "“realistic” for actuators and sensors, velocity controller, in which the robot "
        f"{_OUTCOMES[episode.outcome]}. The estimate takes the feet to stand still: after "
        "take-off it means nothing.",
    )


def _base_pitch(*arms: Arm) -> _Picture:
    controller = arms[0].config.controller
    ends = " and ".join(
        f"{arm.name} the momentum constraint the robot {_OUTCOMES[arm.episode.outcome]}"
        for arm in sorted(arms, key=lambda arm: arm.name)
    )
    return _drawing(
        base_pitch_figure({arm.name: arm.episode for arm in arms}),
        f"Two curves of the base pitch over time, {controller} controller: {ends}.",
        f"Fig. 6: base pitch with the {controller} controller.",
    )


def _drawing(figure: Figure, alt: str, caption: str) -> _Picture:
    """A figure that takes on the colour scheme of the page around it."""
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    svg = buffer.getvalue()
    for name, (drawn, _, _) in _COLORS.items():
        svg = svg.replace(drawn, f"var(--{name})")
    light, dark = (
        ";".join(f"--{name}:{color[scheme]}" for name, color in _COLORS.items())
        for scheme in (1, 2)
    )
    style = f":root{{{light}}}@media(prefers-color-scheme:dark){{:root{{{dark}}}}}"
    svg = svg.replace("<defs>", f"<defs><style>{style}</style>", 1)
    width, height = (round(96 * inches) for inches in figure.get_size_inches())
    return _Picture(_data_uri("image/svg+xml", svg.encode()), width, height, alt, caption)


def _photo(picture: Frame) -> str:
    import imageio.v3 as iio

    return _data_uri("image/webp", iio.imwrite("<bytes>", picture, extension=".webp", quality=85))


def _video(config: JumpConfig, seed: int, console: Console) -> str:
    with tempfile.TemporaryDirectory(prefix="icub-jump-") as scratch:
        file = Path(scratch) / "jump.mp4"
        record_video(file, config, seed, console)
        return _data_uri("video/mp4", file.read_bytes())


def _data_uri(media_type: str, content: bytes) -> str:
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


def _fields(configs: list[JumpConfig]) -> list[tuple[str, str, bool]]:
    """Name and value of each field, and whether that is the default."""
    default = JumpConfig()
    fields = []
    for name in (field.name for field in dataclasses.fields(JumpConfig)):
        values = list(dict.fromkeys(getattr(config, name) for config in configs))
        # Both controllers are always shown: neither is a choice of the user's.
        usual = name == "controller" or values == [getattr(default, name)]
        fields.append((name, " and ".join(str(value) for value in values), usual))
    return fields


def _number(value: float | None, unit: str | None = None, signed: bool = False) -> str:
    """As in the terminal's table, with a true minus sign and a true dash."""
    text = number(value, unit, signed)
    return "–" if text == "-" else text.replace("-", "−")  # noqa: RUF001


def _render(**content: Any) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = _number
    return environment.get_template("report.html").render(content)
