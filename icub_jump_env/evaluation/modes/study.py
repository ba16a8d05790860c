"""The realism study: one imperfection after the other, for both controllers.

The paper names three reasons why its torque controller did not jump on the real robot:
computation time, the tuning of the low-level torque control, and errors of the torques
estimated from force/torque sensors. Each is switched on here by itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

from rich import box
from rich.console import Console
from rich.table import Table

from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.evaluation.options import STUDY_EPISODES, EvalOptions
from icub_jump_env.evaluation.report.output import save_figure, say, show, write_json
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.report.provenance import command, provenance
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.evaluation.quantities import DEG
from icub_jump_env.simulation.actuators.config import ACTUATORS
from icub_jump_env.simulation.actuators.torque_loops import TorqueFeedback
from icub_jump_env.simulation.sensor_models import SensorConfig, SensorError

_LEVER = 0.05
"""Moment error (Nm) that goes with a force error of 1 N, as in the realistic preset."""

CONTROLLERS: tuple[ControllerName, ...] = get_args(ControllerName)


@dataclass(frozen=True)
class Case:
    """One imperfection.

    Attributes:
        group: What it belongs to.
        label: What is changed in it.
        changes: Fields of the configuration that make it.
    """

    group: str
    label: str
    changes: dict[str, Any]


def cases() -> list[Case]:
    """All cases of the study."""
    feedback = ACTUATORS["torque_feedback"]
    delays = [
        Case("computation time", _ticks(ticks), {"command_delay": ticks}) for ticks in range(4)
    ]
    loops = [
        Case("low-level torque control", "ideal", {"actuators": "ideal"}),
        *(
            Case(
                "low-level torque control",
                f"feedback, {bandwidth:g} Hz",
                {
                    "actuators": dataclasses.replace(
                        feedback, torque_loop=TorqueFeedback(bandwidth=bandwidth)
                    )
                },
            )
            for bandwidth in (50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5)
        ),
        Case("low-level torque control", "current control", {"actuators": "current_control"}),
    ]
    # Errors of the feet's sensors reach the joints through the torque feedback.
    worst = _offset(80.0)
    sensors = [
        ("no error", SensorConfig()),
        *((f"offset {force:g} N", _offset(force)) for force in (10.0, 20.0, 40.0)),
        ("offset 80 N", worst),
        *(
            (
                f"drift {rate:g} N/s",
                SensorConfig(
                    force=SensorError(drift=rate), moment=SensorError(drift=_LEVER * rate)
                ),
            )
            for rate in (20.0, 80.0)
        ),
        *((f"calibration {gain:.0%}", SensorConfig(force_gain=gain)) for gain in (0.05, 0.1, 0.2)),
    ]
    errors = [
        Case("force/torque sensors", label, {"actuators": "torque_feedback", "sensors": config})
        for label, config in sensors
    ]
    errors.append(
        Case(
            "force/torque sensors",
            "offset 80 N, current c.",
            {"actuators": "current_control", "sensors": worst},
        )
    )
    motors = [
        Case("motors", "rated", {"actuators": "ideal"}),
        Case("motors", "DC, limits raised", {"actuators": "dc_motor"}),
        Case("motors", "DC, original limits", {"actuators": "original_limits"}),
    ]
    realistic = ACTUATORS["realistic"]
    current = dataclasses.replace(realistic, torque_loop=ACTUATORS["current_control"].torque_loop)
    together = [
        Case("all together", label, {"actuators": actuators, "sensors": "realistic"} | delay)
        for delay, words in (({}, ""), ({"command_delay": 2}, ", 2 ticks"))
        for label, actuators in (
            (f"torque feedback{words}", realistic),
            (f"current control{words}", current),
        )
    ]
    return [*delays, *loops, *errors, *motors, *together]


@dataclass(frozen=True)
class CaseResult:
    """Outcome of a case by controller."""

    case: Case
    summaries: dict[ControllerName, Summary]


def run_study(options: EvalOptions, console: Console, progress: Console) -> None:
    """Run ``eval.py --study realism``."""
    results = run_cases(options, progress)
    wrote = []
    if options.json is not None:
        write_json(options.json, study_report(results, options))
        wrote.append(options.json)
    if options.plot is not None:
        from icub_jump_env.evaluation.figures.study import realism_figure

        file = save_figure(options.plot, "realism.png", realism_figure(results))
        wrote.append(file)
    show(console, render(results, options))
    for path in wrote:
        say(console, f"wrote {path}")
    if options.plot is None:
        say(progress, "for the picture add --plot FOLDER")


def run_cases(options: EvalOptions, progress: Console) -> list[CaseResult]:
    """Run every case with both controllers."""
    all_cases = cases()
    work, owners = [], []
    for index, case in enumerate(all_cases):
        for controller in CONTROLLERS:
            config = dataclasses.replace(options.config, controller=controller, **case.changes)
            for seed in _seeds(config, options):
                work.append(Job(config, seed))
                owners.append((index, controller))
    episodes: dict[tuple[int, ControllerName], list[Episode]] = {o: [] for o in owners}
    for owner, episode in zip(owners, run_all(work, options.jobs, progress), strict=True):
        episodes[owner].append(episode)
    return [
        CaseResult(case, {c: Summary.of(episodes[index, c]) for c in CONTROLLERS})
        for index, case in enumerate(all_cases)
    ]


def _seeds(config: JumpConfig, options: EvalOptions) -> range:
    """One episode is enough where nothing is random."""
    random = config.sensor_config != SensorConfig() or config.randomization_config.varies
    episodes = (options.episodes or STUDY_EPISODES) if random else 1
    return range(options.seed, options.seed + episodes)


def render(results: Sequence[CaseResult], options: EvalOptions) -> Table:
    """The table for the terminal."""
    table = Table(
        title=f"Realism study, {options.config.commanded_height * 100:g} cm jump",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column("", no_wrap=True)
    for controller in CONTROLLERS:
        for quantity in ("rise", "rot.", "landed"):
            table.add_column(f"{controller[:3]}.\n{quantity}", justify="right", no_wrap=True)
    group = ""
    for result in results:
        if result.case.group != group:
            group = result.case.group
            table.add_section()
            table.add_row(f"[bold]{group}[/bold]")
        cells = [cell for c in CONTROLLERS for cell in _cells(result.summaries[c])]
        table.add_row(f"  {result.case.label}", *cells)
    table.caption = (
        "vel., tor.: velocity and torque controller; rise of the CoM in cm and rotation in "
        "flight in deg: medians; landed: share in %"
    )
    table.caption_justify = "left"
    return table


def _cells(summary: Summary) -> tuple[str, str, str]:
    rise = summary.median("flight_height")
    rotation = summary.median("flight_rotation")
    return f"{100 * rise:.2f}", f"{DEG * rotation:.1f}", f"{100 * summary.landed.share:.0f}"


def study_report(results: Sequence[CaseResult], options: EvalOptions) -> dict[str, Any]:
    """Everything the study found, for ``--json``."""
    return {
        "mode": "study",
        "command": command(),
        **provenance(options.config, options.seed),
        "cases": [
            {
                **dataclasses.asdict(result.case),
                **{c: result.summaries[c].as_dict() for c in CONTROLLERS},
            }
            for result in results
        ],
    }


def _offset(force: float) -> SensorConfig:
    return SensorConfig(force=SensorError(bias=force), moment=SensorError(bias=_LEVER * force))


def _ticks(ticks: int) -> str:
    return f"delay of {ticks} control tick{'' if ticks == 1 else 's'}"
