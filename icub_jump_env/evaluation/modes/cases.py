"""The cases of each study."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from icub_jump_env.robot.urdf import model_names
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig
from icub_jump_env.simulation.actuators.torque_loops import TorqueFeedback
from icub_jump_env.simulation.sensor_models import SensorConfig, SensorError

_LEVER = 0.05
"""Moment error (Nm) that goes with a force error of 1 N, as in the realistic preset."""


@dataclass(frozen=True)
class Case:
    """One kind of jump.

    Attributes:
        group: What it belongs to.
        label: What is changed in it.
        changes: Fields and shortcuts of the configuration that make it.
    """

    group: str
    label: str
    changes: dict[str, Any]


def constraints() -> list[Case]:
    """Task and momentum as weighted costs, and as constraints, as the paper prints them."""
    return [
        Case(
            f"{100 * height:g} cm, {world} world",
            form,
            {"jump_height": height, "constraints": form, "randomization": randomization},
        )
        for height in (0.04, 0.06)
        for world, randomization in (("nominal", "none"), ("full", "full"), ("hard", "hard"))
        for form in ("soft", "hard")
    ]


def launch_end() -> list[Case]:
    """What ends the launch."""
    return [
        Case("", "at T or lift-off", {"launch_end": "time"}),
        Case("", "at lift-off alone", {"launch_end": "lift_off"}),
    ]


def robots() -> list[Case]:
    """The nominal jump of every iCub."""
    return [Case("", name, {"robot": name}) for name in model_names()]


def realism() -> list[Case]:
    """One imperfection after the other.

    The paper names three reasons why its torque controller did not jump on the real robot:
    computation time, the tuning of the low-level torque control, and errors of the torques
    estimated from force/torque sensors. Each is switched on here by itself.
    """
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
