"""What the policies of disturbed worlds feel and what they do about it.

    python -m experiments.feedback --controller velocity --plot docs/images

They are linear: the table has what moves each axis most, and the picture the mean action in worlds
that differ in their slope, and after pushes forward and backward.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.figures import feedback_figure
from experiments.headroom import starts
from experiments.rivals import Watched
from experiments.seeds import TUNING
from icub_jump_env.checks import check_count
from icub_jump_env.control.config import ControllerName
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import make_env, planned, run_episode
from icub_jump_env.evaluation.report.output import (
    check_writable,
    new_table,
    progress_display,
    show,
    write_figures,
)
from icub_jump_env.policy import NetworkPolicy, load_policy
from icub_jump_env.policy.saving import SHIPPED, LoadedPolicy
from icub_jump_env.simulation.disturbances import PUSH_DURATION

Array = NDArray[np.float64]

SHOWN = 5
"""Inputs of each axis in the table."""


@dataclass(frozen=True)
class FeedbackOptions:
    """Show what a policy feels and does.

    Attributes:
        controller: Controller of the launching phase.
        episodes: To watch, at most 200.
        plot: Draw the picture into this folder.
    """

    controller: ControllerName = "velocity"
    episodes: int = 200
    plot: Path | None = None

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 2, len(TUNING))


class Launches(NamedTuple):
    """What was seen and done in some launches of one duration.

    Attributes:
        time: (k,) of each step (s).
        inputs: (n, k, m) what the policy saw.
        actions: (n, k, axes) what it did.
        slope: (n,) of the ground, rising ahead (rad).
        push: (n,) of the launch, forward (Ns).
        push_time: (n,) when it ends (s).
    """

    time: Array
    inputs: Array
    actions: Array
    slope: Array
    push: Array
    push_time: Array


def watch(policy: LoadedPolicy, used: range, console: Console) -> Launches:
    """Launches with a policy, at the middle of its commands, so that they last equally long."""
    config = policy.card.config
    config = config.replace(jump_height=sum(config.jump_heights) / 2, early_end=True)
    steps = int(planned(config).duration * config.agent_frequency)
    names = list(config.layout.scales)
    columns = [names.index(name) for name in policy.card.inputs]
    env, seen, done, worlds = make_env(config), [], [], []
    with progress_display(console) as display:
        for seed, start in zip(
            display.track(used, description="watching"), starts(config, used), strict=True
        ):
            watched = Watched(policy)
            world = run_episode(env, seed, watched).world
            if len(watched.actions) >= steps:  # else it fell in the launch
                seen.append(np.array(watched.observations[:steps])[:, columns])
                done.append(watched.actions[:steps])
                worlds.append((world["slope"], world["push"], start.push + PUSH_DURATION))
    env.close()
    slope, push, push_time = np.array(worlds).T
    time = np.arange(steps) / config.agent_frequency
    return Launches(time, np.array(seen), np.array(done), slope, push, push_time)


def render(policy: LoadedPolicy, launches: Launches) -> Table:
    """What moves each axis most: action per standard deviation of an input, over its launches."""
    network = policy.policy
    if not isinstance(network, NetworkPolicy) or network.hidden:
        raise ConfigError("policy", policy.card.kind, "a linear one")
    ((weight, _),) = network.layers
    spread = launches.inputs.reshape(-1, weight.shape[1]).std(axis=0)
    table = new_table(1, "moves", *(f"{n}." for n in range(1, SHOWN + 1)))
    for axis, row in zip(network.axes, weight * spread, strict=True):
        largest = np.argsort(-np.abs(row))[:SHOWN]
        table.add_row(axis, *(f"{network.inputs[i]} {row[i]:+z.2f}" for i in largest))
    table.caption = f"{len(launches.slope)} launches; action per standard deviation of the input"
    return table


def run(options: FeedbackOptions) -> None:
    """Watch, print and draw."""
    console, progress = Console(), Console(stderr=True)
    if options.plot is not None:
        check_writable("plot", options.plot, folder=True)
    policy = load_policy(SHIPPED / f"disturbed-{options.controller}.safetensors")
    launches = watch(policy, TUNING[: options.episodes], progress)
    show(console, render(policy, launches))
    if options.plot is not None:
        residual = policy.card.config.residual
        figures = {
            f"feedback_{options.controller}.png": partial(feedback_figure, launches, residual)
        }
        write_figures(options.plot, figures, progress)


if __name__ == "__main__":
    guarded(lambda: run(parse(FeedbackOptions, sys.argv[1:])))
