"""``eval.py --report``: both controllers' jumps on one HTML page, readable without a network."""

from __future__ import annotations

import dataclasses
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.figures.paper import (
    base_pitch_figure,
    com_reference_figure,
    launch_figure,
    realistic,
    realistic_episode,
    robot_figure,
)
from icub_jump_env.evaluation.figures.snapshots import Shot, take_snapshots
from icub_jump_env.evaluation.figures.style import on_a_page
from icub_jump_env.evaluation.modes.nominal import REPETITIONS, Arm, run_nominal
from icub_jump_env.evaluation.modes.video import SLOW_MOTION, check_video, record_video
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.quantities import CONTROLLERS
from icub_jump_env.evaluation.report.output import check_writable, progress_display, say
from icub_jump_env.evaluation.report.page import Picture, data_uri, drawing, photo, render
from icub_jump_env.evaluation.report.provenance import command, versions
from icub_jump_env.evaluation.statistics.paper import MOMENTUM_EQUATION, comparison_rows, verdict
from icub_jump_env.files import write_file
from icub_jump_env.simulation.render_config import RenderConfig

PAGE = "index.html"

_OUTCOMES = {
    "stood": "lands and stands",
    "fell": "falls",
    "no take-off": "does not leave the ground",
    "diverged": "leaves the simulation diverging",
}


def run(options: EvalOptions, _: Sequence[Contender], console: Console, progress: Console) -> None:
    """Run ``eval.py --report``."""
    assert options.report is not None  # else it were another mode
    say(console, f"wrote {write_report(options.report, options.config, options.seed, progress)}")


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
        dataclasses.replace(config.for_controller(controller), rendering=RenderConfig())
        for controller in CONTROLLERS
    ]
    realistic(configs[0])  # refuses before any work what cannot be drawn of it
    with on_a_page():
        page = render(
            config=configs[0],
            seed=seed,
            jumps=[_jump(each, seed, console) for each in configs],
            com_reference=drawing(
                com_reference_figure(configs[0]),
                "Two curves over the launch: the vertical CoM velocity, from zero to the take-off "
                "velocity, and the vertical CoM acceleration.",
                "Fig. 1: the vertical CoM reference that both controllers follow.",
            ),
            robot=_robot(configs[0], seed),
            fields=_fields(configs),
            versions=versions(),
            command=shlex.join(command()),
            slow_motion=SLOW_MOTION,
            repetitions=REPETITIONS,
        )
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / PAGE
    write_file(file, page.encode())
    return file


def _jump(config: JumpConfig, seed: int, console: Console) -> dict[str, Any]:
    """What the page shows of one controller."""
    ours, switched = run_nominal(config, seed, trace=True, console=console)
    with progress_display(console) as progress:
        progress.add_task("taking pictures", total=None)
        shots, switched_shots = (
            take_snapshots(arm.config, arm.episode) for arm in (ours, switched)
        )
    apex = next((shot for shot in shots if shot.name == "Apex"), shots[0])
    return {
        "controller": config.controller_name,
        "equation": MOMENTUM_EQUATION[config.controller_name],
        "ends": _OUTCOMES[ours.episode.outcome],
        "rows": {
            row.quantity: row for row in comparison_rows(config, ours.repeated, switched.repeated)
        },
        "verdict": verdict(config, ours.episode, switched.episode),
        "video": _video(config, seed, console),
        "poster": photo(apex.picture),
        "moments": _moments(ours, shots),
        "switched_moments": _moments(switched, switched_shots),
        "launch": _launch(ours),
        "base_pitch": _base_pitch(ours, switched),
    }


def _moments(arm: Arm, shots: Sequence[Shot]) -> list[tuple[Shot, Picture]]:
    """A strip of pictures, each with the moment that it shows."""
    moments = []
    for shot in shots:
        height, width, _ = shot.close_up.shape
        alt = (
            f"The iCub, {arm.config.controller_name} controller, {arm.name} the momentum constraint: "
            f"{shot.name.lower()} at {shot.time:.3f} s"
        )
        moments.append((shot, Picture(photo(shot.close_up), width, height, alt)))
    return moments


def _launch(arm: Arm) -> Picture:
    controller = arm.config.controller_name
    number, quantity = {"velocity": (2, "velocities"), "torque": (3, "torques")}[controller]
    return drawing(
        launch_figure(arm.config, arm.episode.trace),
        f"Four plots over time: the {quantity} of the left ankle, knee and hip pitch joints in "
        "the launch, desired and measured, and the CoM height, reference and true.",
        f"Fig. {number}: joint {quantity} and CoM height with the {controller} controller; "
        "dashed: desired, solid: measured. T is the commanded take-off.",
    )


def _robot(config: JumpConfig, seed: int) -> Picture:
    episode = realistic_episode(config, seed)
    return drawing(
        robot_figure(config, episode),
        "Four plots over time: the velocities of the left ankle, knee and hip pitch joints in "
        "the launch, desired and measured, and the CoM height, estimated, true and reference.",
        "Fig. 4: the paper shows the real robot here; this is a simulation with the presets "
        "“realistic” for actuators and sensors, velocity controller, in which the robot "
        f"{_OUTCOMES[episode.outcome]}. The estimate takes the feet to stand still: after "
        "take-off it means nothing.",
    )


def _base_pitch(*arms: Arm) -> Picture:
    controller = arms[0].config.controller_name
    ends = " and ".join(
        f"{arm.name} the momentum constraint the robot {_OUTCOMES[arm.episode.outcome]}"
        for arm in sorted(arms, key=lambda arm: arm.name)
    )
    return drawing(
        base_pitch_figure({arm.name: arm.episode for arm in arms}),
        f"Two curves of the base pitch over time, {controller} controller: {ends}.",
        f"Fig. 6: base pitch with the {controller} controller.",
    )


def _video(config: JumpConfig, seed: int, console: Console) -> str:
    with tempfile.TemporaryDirectory(prefix="icub-jump-") as scratch:
        file = Path(scratch) / "jump.mp4"
        record_video(file, config, seed, console)
        return data_uri("video/mp4", file.read_bytes())


def _fields(configs: Sequence[JumpConfig]) -> list[tuple[str, str, bool]]:
    """Name and value of each field, and whether that is the default."""
    default = JumpConfig()
    fields = []
    for name in (field.name for field in dataclasses.fields(JumpConfig)):
        values = list(dict.fromkeys(getattr(config, name) for config in configs))
        # Both controllers are always shown: neither is a choice of the user's.
        usual = name == "controller" or values == [getattr(default, name)]
        fields.append((name, " and ".join(str(value) for value in values), usual))
    return fields
