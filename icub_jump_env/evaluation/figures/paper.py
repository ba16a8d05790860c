"""The paper's figures 1, 2 or 3, 4 and 6, redrawn from our simulation."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.episodes.rollout import (
    Episode,
    make_env,
    planned,
    run_episode,
    traced,
)
from icub_jump_env.evaluation.figures.style import (
    ACCENT,
    DESIRED,
    MEASURED,
    Figure,
    describe,
    mark_takeoff,
    panels,
)
from icub_jump_env.evaluation.quantities import CM, commands
from icub_jump_env.robot.robot import Robot
from icub_jump_env.snapshot import Snapshot

Trace = Sequence[Snapshot]

WIDTH = 5.0
"""Of a figure (inches): its letters can be read on the screen of a phone, too."""


def paper_figures(
    config: JumpConfig, episodes: Mapping[str, Episode], seed: int
) -> dict[str, Callable[[], Figure]]:
    """What draws each figure, by its file name.

    Args:
        config: The jump's configuration.
        episodes: Traced episodes ``with`` and ``without`` the momentum constraint.
        seed: Their seed.
    """
    trace = episodes["with" if config.controller_config.momentum_control else "without"].trace
    number = _LAUNCH[config.controller_name].figure.lower().replace(". ", "")
    return {
        "fig1_com_reference.png": partial(com_reference_figure, config),
        f"{number}_launch.png": partial(launch_figure, config, trace),
        "fig4_realistic.png": lambda: robot_figure(config, realistic_episode(config, seed)),
        "fig6_base_pitch.png": partial(base_pitch_figure, episodes),
    }


def com_reference_figure(config: JumpConfig) -> Figure:
    """Fig. 1: velocity and acceleration of the vertical CoM reference."""
    plan = planned(config)
    time = np.linspace(0.0, plan.duration, 400)
    figure, ((velocity, acceleration),) = panels((WIDTH, 2.6), columns=2)
    velocity.plot(time, [plan.sample(t).com_velocity[2] for t in time], color=DESIRED)
    describe(velocity, "vertical CoM velocity", "m/s")
    acceleration.plot(time, [plan.sample(t).com_acceleration[2] for t in time], color=DESIRED)
    describe(acceleration, "vertical CoM acceleration", "m/s²")
    figure.suptitle(
        f"Fig. 1: CoM reference, {commands(*config.jump_heights)} jump, "
        f"{CM * plan.displacement:.3g} cm displacement",
        fontsize=11,
    )
    return figure


class _Shown(NamedTuple):
    """What the launch figure of a controller shows of the joints."""

    figure: str
    quantity: str
    command: str
    unit: str
    limit: Callable[[Robot], NDArray[np.float64]]


LIMIT = "-."
"""Style of the line at a joint's limit."""

_LAUNCH: dict[ControllerName, _Shown] = {
    "velocity": _Shown(
        "Fig. 2", "joint_velocity", "joint_velocity_command", "rad/s", lambda r: r.velocity_limit
    ),
    "torque": _Shown(
        "Fig. 3", "joint_torque", "joint_torque_command", "Nm", lambda r: r.effort_limit
    ),
}


def launch_figure(config: JumpConfig, trace: Trace) -> Figure:
    """Fig. 2 (joint velocities) or Fig. 3 (joint torques) and CoM height, desired and measured."""
    shown = _LAUNCH[config.controller_name]
    figure, axes = panels((WIDTH, 4.6), 2, 2)
    *joints, height = axes.flat
    _draw_joints(joints, config, trace)
    _draw_height(height, config, trace)
    _add_legend(figure)
    duration = planned(config).duration
    figure.suptitle(
        f"{shown.figure}: {config.controller_name} approach, take-off commanded at {duration:.2f} s",
        fontsize=11,
    )
    return figure


def realistic(config: JumpConfig) -> JumpConfig:
    """The jump of Fig. 4: as on the real robot, which jumped with the velocity approach."""
    return dataclasses.replace(
        config.for_controller("velocity"), actuators="realistic", sensors="realistic"
    )


def realistic_episode(config: JumpConfig, seed: int) -> Episode:
    """The traced episode of :func:`realistic`."""
    with contextlib.closing(make_env(traced(realistic(config)))) as env:
        return run_episode(env, seed, trace=True)


def robot_figure(config: JumpConfig, episode: Episode) -> Figure:
    """Fig. 4: the jump of the real robot, here simulated with realistic actuators and sensors.

    As in the paper the CoM is the one estimated from the encoders as if the feet stood
    still, which means nothing after take-off; the true one is drawn beside it.
    """
    figure, axes = panels((WIDTH, 4.6), 2, 2)
    *joints, height = axes.flat
    robot = realistic(config)
    _draw_joints(joints, robot, episode.trace)
    _draw_height(height, robot, episode.trace, estimated=True)
    _add_legend(figure, estimated=True)
    figure.suptitle(
        "Fig. 4: velocity approach, realistic actuators and sensors\n"
        "(the paper shows the real robot)",
        fontsize=11,
    )
    return figure


def _draw_joints(axes: Sequence[Axes], config: JumpConfig, trace: Trace) -> None:
    shown, robot = _LAUNCH[config.controller_name], config.robot_value
    time = np.array([s.time for s in trace])
    launch = time <= planned(config).duration
    for axis, joint in zip(axes, ("ankle_pitch", "knee", "hip_pitch"), strict=True):
        index = robot.joint_names.index(f"l_{joint}")
        measured = np.array([getattr(s, shown.quantity)[index] for s in trace])
        # A snapshot holds the command that led to it, issued one control period before.
        desired = np.array([getattr(s, shown.command)[index] for s in trace[1:]])
        axis.plot(time[launch], measured[launch], color=MEASURED)
        axis.plot(time[:-1][launch[1:]], desired[launch[1:]], color=DESIRED, ls="--")
        limit = shown.limit(robot)[index]
        if float(np.abs(measured[launch]).max()) > 0.8 * limit:
            sign = np.sign(measured[launch][-1])
            axis.axhline(sign * limit, color=ACCENT, lw=0.8, ls=LIMIT)
        describe(axis, f"left {joint.replace('_', ' ')}", shown.unit)


def _draw_height(axis: Axes, config: JumpConfig, trace: Trace, estimated: bool = False) -> None:
    duration = planned(config).duration
    early = [s for s in trace if s.time <= duration + 0.6]
    time = [s.time for s in early]
    true = [s.com[2] for s in early]
    if estimated:
        axis.plot(time, [s.com_estimate[2] for s in early], color=MEASURED)
        axis.plot(time, true, color=ACCENT)
    else:
        axis.plot(time, true, color=MEASURED)
    axis.plot(time, [s.com_reference[2] for s in early], color=DESIRED, ls="--")
    mark_takeoff(axis, duration)
    describe(axis, "CoM height", "m")


def _add_legend(figure: Figure, estimated: bool = False) -> None:
    styles = [("estimated" if estimated else "measured", MEASURED, "-")]
    if estimated:
        styles.append(("true", ACCENT, "-"))
    styles += [("desired", DESIRED, "--"), ("limit", ACCENT, LIMIT), ("take-off", ACCENT, ":")]
    handles = [Line2D([], [], color=color, ls=ls, label=label) for label, color, ls in styles]
    figure.legend(
        handles=handles, frameon=False, loc="outside lower center",
        ncols=len(styles), columnspacing=1.0, fontsize=9, handlelength=1.5,
    )  # fmt: skip


def base_pitch_figure(episodes: Mapping[str, Episode]) -> Figure:
    """Fig. 6: base pitch with and without the momentum constraint."""
    figure, ((axis,),) = panels((WIDTH, 3.2))
    takeoffs = [episode.jump["takeoff_time"] for episode in episodes.values()]
    takeoff = min((t for t in takeoffs if not math.isnan(t)), default=math.inf)
    fallen = [e.trace[-1].time for e in episodes.values() if e.outcome == "fell"]
    end = max([takeoff + 0.8, *fallen])
    for name, color, label in (
        ("with", MEASURED, "with the momentum constraint"),
        ("without", DESIRED, "without"),
    ):
        shown = [s for s in episodes[name].trace if s.time <= end]
        time, pitch = [s.time for s in shown], np.degrees([s.base_pitch for s in shown])
        axis.plot(time, pitch, color=color, label=label)
        if episodes[name].outcome == "fell":
            axis.plot(time[-1], pitch[-1], "x", color=color)
            axis.annotate(
                "falls",
                (time[-1], pitch[-1]),
                (-8, -3),
                textcoords="offset points",
                color=color,
                ha="right",
            )
    if math.isfinite(takeoff):
        mark_takeoff(axis, takeoff)
        bottom = axis.get_ylim()[0]
        axis.annotate(
            "take-off", (takeoff, bottom), (4, 4), textcoords="offset points", color=ACCENT
        )
    describe(axis, "", "deg")
    axis.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    figure.suptitle("Fig. 6: base pitch (positive: forward)", fontsize=11)
    return figure
