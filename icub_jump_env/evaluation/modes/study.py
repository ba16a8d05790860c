"""The realism study: one imperfection after the other, for both controllers.

The paper names three reasons why its torque controller did not jump on the real robot:
computation time, the tuning of the low-level torque control, and errors of the torques
estimated from force/torque sensors. Each is switched on here by itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import varies
from icub_jump_env.evaluation.figures.study import realism_figure
from icub_jump_env.evaluation.options import STUDY_EPISODES, EvalOptions
from icub_jump_env.evaluation.quantities import CONTROLLERS, commands, number
from icub_jump_env.evaluation.report.output import new_table, say, show, write_results
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig
from icub_jump_env.simulation.actuators.torque_loops import TorqueFeedback
from icub_jump_env.simulation.sensor_models import SensorConfig, SensorError

_LEVER = 0.05
"""Moment error (Nm) that goes with a force error of 1 N, as in the realistic preset."""


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
    realistic = ACTUATORS["realistic"]
    current = dataclasses.replace(realistic, torque_loop=ACTUATORS["current_control"].torque_loop)
    groups: dict[str, dict[str, dict[str, Any]]] = {
        "computation time": {_ticks(ticks): {"command_delay": ticks} for ticks in range(4)},
        "low-level torque control": {
            "ideal": {"actuators": "ideal"},
            **{
                f"feedback, {bandwidth:g} Hz": {"actuators": _feedback(bandwidth)}
                for bandwidth in (50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5)
            },
            "current control": {"actuators": "current_control"},
        },
        # Errors of the feet's sensors reach the joints through the torque feedback.
        "force/torque sensors": {
            **{
                label: {"actuators": "torque_feedback", "sensors": sensors}
                for label, sensors in _sensor_errors().items()
            },
            "offset 80 N, current c.": {"actuators": "current_control", "sensors": _offset(80.0)},
        },
        "motors": {
            "rated": {"actuators": "ideal"},
            "DC, limits raised": {"actuators": "dc_motor"},
            "DC, original limits": {"actuators": "original_limits"},
        },
        "all together": {
            f"{loop}{words}": {"actuators": actuators, "sensors": "realistic"} | delay
            for delay, words in (({}, ""), ({"command_delay": 2}, ", 2 ticks"))
            for loop, actuators in (("torque feedback", realistic), ("current control", current))
        },
    }
    return [
        Case(group, label, changes)
        for group, labelled in groups.items()
        for label, changes in labelled.items()
    ]


def _ticks(ticks: int) -> str:
    return f"delay of {ticks} control tick{'' if ticks == 1 else 's'}"


def _feedback(bandwidth: float) -> ActuatorConfig:
    loop = TorqueFeedback(bandwidth=bandwidth)
    return dataclasses.replace(ACTUATORS["torque_feedback"], torque_loop=loop)


def _sensor_errors() -> dict[str, SensorConfig]:
    return {
        "no error": SensorConfig(),
        **{f"offset {force:g} N": _offset(force) for force in (10.0, 20.0, 40.0, 80.0)},
        **{f"drift {rate:g} N/s": _drift(rate) for rate in (20.0, 80.0)},
        **{f"calibration {gain:.0%}": SensorConfig(force_gain=gain) for gain in (0.05, 0.1, 0.2)},
    }


def _offset(force: float) -> SensorConfig:
    return SensorConfig(force=SensorError(bias=force), moment=SensorError(bias=_LEVER * force))


def _drift(rate: float) -> SensorConfig:
    return SensorConfig(force=SensorError(drift=rate), moment=SensorError(drift=_LEVER * rate))


@dataclass(frozen=True)
class CaseResult:
    """Outcome of a case by controller."""

    case: Case
    summaries: dict[ControllerName, Summary]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        summaries = {name: summary.as_dict() for name, summary in self.summaries.items()}
        return dataclasses.asdict(self.case) | summaries


def run(options: EvalOptions, _: Sequence[Contender], console: Console, progress: Console) -> None:
    """Run ``eval.py --study realism``."""
    results = run_cases(options, progress)
    found = {"cases": [result.as_dict() for result in results]}
    write_results(options, progress, found, {"realism.png": partial(realism_figure, results)})
    show(console, render(results, options))
    if options.plot is None:
        say(progress, "for the picture add --plot FOLDER")


def run_cases(options: EvalOptions, progress: Console) -> list[CaseResult]:
    """Run every case with both controllers."""
    all_cases = cases()
    work, owners = [], []
    for index, case in enumerate(all_cases):
        for controller in CONTROLLERS:
            jump = options.config.for_controller(controller)
            config = dataclasses.replace(jump, **case.changes)
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
    episodes = (options.episodes or STUDY_EPISODES) if varies(config) else 1
    return range(options.seed, options.seed + episodes)


def render(results: Sequence[CaseResult], options: EvalOptions) -> Table:
    """The table for the terminal."""
    headings = [
        f"{c[:3]}.\n{quantity}" for c in CONTROLLERS for quantity in ("rise", "rot.", "landed")
    ]
    title = f"Realism study, {commands(*options.config.jump_heights)} jump"
    table = new_table(1, "", *headings, title=title)
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
    return table


def _cells(summary: Summary) -> tuple[str, str, str]:
    return (
        number(summary.median("flight_height"), "cm"),
        number(summary.median("flight_rotation"), "deg"),
        number(summary.landed.share, "%"),
    )
