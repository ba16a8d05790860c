"""A whole-body QP with contact wrenches that lands the robot, against landing by feedback.

    python -m experiments.wrench_landing --episodes 20
    python -m experiments.wrench_landing --realistic
    python -m experiments.wrench_landing --parts

The QP of eq. 6 decides the torques of all joints once the impact is over. Its demands come from the
same capture point, lunge and heights as those of
:class:`icub_jump_env.control.landing.FeedbackLanding`. With ``--parts`` the QP loses its
parts, one at a time. Gains were chosen on the first 40 of the tuning seeds; jumped are later ones.
"""

from __future__ import annotations

import math
import sys
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TUNING
from experiments.wrench_controller import WrenchGains, WrenchLanding
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.control.landing import FeedbackLanding, Landing
from icub_jump_env.control.phases import Phase, Tick
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.modes.landing_cases import (
    FEEDBACK,
    VARIANTS,
    LandingCase,
    landing_cases,
)
from icub_jump_env.evaluation.quantities import CONTROLLERS, number, seeds
from icub_jump_env.evaluation.report.output import new_table, progress_display, show
from icub_jump_env.evaluation.statistics.summary import Rate
from icub_jump_env.simulation.actuators.config import ActuatorName

Array = NDArray[np.float64]

CASES = (
    "4 cm, full",
    "4 cm, hard",
    "8 cm after 8 cm, full",
    "plan, full",
    "floor tilt fore-aft +5",
    "step under the left foot 2",
    "rotation at lift-off -10",
    "push after landing +0.3",
    "push after landing -0.3",
    "push after landing -0.35",
)
"""Ends of the names of the landing study's cases that are jumped."""

FEW = (CASES[0], CASES[1], CASES[4], CASES[7])
"""Those that are jumped with realistic actuators."""

HARDEST = "push after landing -0.3"
"""The case in which parts of the controller are taken away."""

FIRST = 40
"""The first of the tuning seeds on which no gain was chosen."""


@dataclass(frozen=True)
class WrenchOptions:
    """Compare the landings.

    Attributes:
        episodes: Of each row.
        realistic: With realistic actuators, whose torque loops have a bandwidth and friction.
        parts: Take the parts of the QP away instead, one at a time.
    """

    episodes: int = 20
    realistic: bool = False
    parts: bool = False

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1, len(TUNING) - FIRST)


PARTS: dict[str, WrenchGains] = {
    "all parts": WrenchGains(),
    "QP from touch-down on": WrenchGains(impact=0.0),
    "feet as in the launch": WrenchGains(feet_damping=0.0, feet_weight=math.inf),
    "feet not damped": WrenchGains(feet_damping=0.0),
    "damped as a constraint": WrenchGains(feet_weight=math.inf),
    "CoP margin 1 cm": WrenchGains(cop_margin=0.01),
    "no joint damping": WrenchGains(joint_damping=0.0),
    "loads not shared": WrenchGains(wrench_weight=1e-4),
}
"""The controller, and what it is without one of its parts."""


class Watched:
    """A landing whose ticks are timed and whose QPs without a solution are counted.

    Attributes:
        seconds: How long each tick took (s).
        failures: How many QPs had no solution.
    """

    def __init__(self, landing: Landing) -> None:
        self._landing = landing
        self.start = landing.start
        self.seconds: list[float] = []
        self.failures = 0

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick."""
        began = clock.perf_counter()
        tick = self._landing.tick(state, time, residual_target)
        self.seconds.append(clock.perf_counter() - began)
        self.failures += tick.report is not None and tick.report.failed
        return tick


def landing_by_wrenches(env: ICubJumpEnv, gains: WrenchGains) -> WrenchLanding:
    """A landing that can take the place of the environment's, which is by feedback."""
    old = env._controller._landing
    if not isinstance(old, FeedbackLanding):
        raise TypeError("the environment lands without feedback")
    solver = env.config.controller_config.solver
    return WrenchLanding(old._flight, old._residual, old._dt, old._kinematics, solver, gains)


def watch(env: ICubJumpEnv, gains: WrenchGains | None) -> Watched:
    """Watch the landings of an environment; with ``gains`` they are those of the QP."""
    jumping = env._controller
    watched = Watched(jumping._landing if gains is None else landing_by_wrenches(env, gains))
    jumping._controllers[Phase.LANDING] = watched
    return watched


class Landings(NamedTuple):
    """What some landings were like.

    Attributes:
        landed: How many landed.
        force: Median of the largest force under the feet (N).
        failures: QPs without a solution.
        seconds: Median time of a tick (s).
    """

    landed: Rate
    force: float
    failures: int
    seconds: float

    def cells(self) -> list[str]:
        """For tables."""
        landed = f"{self.landed.count}/{self.landed.total}"
        force, time = number(self.force, "N"), f"{1e6 * self.seconds:.0f}"
        return [landed, self.landed.bounds, force, str(self.failures), time]


def land(config: JumpConfig, used: Sequence[int], gains: WrenchGains | None) -> Landings:
    """Jump with the seeds ``used`` and land by feedback, or with ``gains`` by the QP."""
    env = make_env(config)
    watched = watch(env, gains)
    jumps = [run_episode(env, seed).jump for seed in used]
    env.close()
    landed = Rate(sum(bool(jump["landed"]) for jump in jumps), len(jumps))
    force = float(np.nanmedian([jump["landing_force"] for jump in jumps]))
    return Landings(landed, force, watched.failures, float(np.median(watched.seconds)))


def cases(controller: ControllerName, actuators: ActuatorName = "ideal") -> dict[str, JumpConfig]:
    """The jumps of one controller by name."""

    def name(case: LandingCase) -> str:
        return f"{case.group} {case.label}".strip()

    known = landing_cases(JumpConfig.of(controller=controller))
    ends = CASES if actuators == "ideal" else FEW
    chosen = [next(case for case in known if name(case).endswith(end)) for end in ends]
    always = {"controller": controller, "actuators": actuators, **VARIANTS[FEEDBACK]}
    return {name(case): JumpConfig.of(**always, **case.changes) for case in chosen}


def run(options: WrenchOptions) -> None:
    """Compare the landings, or take away the parts of the QP."""
    console, used = Console(), TUNING[FIRST : FIRST + options.episodes]
    actuators: ActuatorName = "realistic" if options.realistic else "ideal"
    with progress_display(Console(stderr=True)) as progress:
        for controller in progress.track(CONTROLLERS):
            if options.parts:
                show(console, render_parts(controller, used))
            else:
                show(console, render_jumps(controller, actuators, used))


def render_jumps(controller: ControllerName, actuators: ActuatorName, used: range) -> Table:
    """Both landings in all cases."""
    title = f"{controller} controller, {actuators} actuators, {seeds(used)}"
    table = _table("jump", "landing", title=title)
    for label, config in cases(controller, actuators).items():
        table.add_row(label, "feedback", *land(config, used, None).cells())
        found = land(config, used, WrenchGains())
        table.add_row("", "wrench QP", *found.cells(), end_section=True)
    return table


def render_parts(controller: ControllerName, used: range) -> Table:
    """The QP without one of its parts, in a hard case."""
    config = cases(controller)[HARDEST]
    title = f"{controller} controller, {HARDEST} m/s, {seeds(used)}"
    table = _table("wrench QP", title=title)
    for label, gains in PARTS.items():
        table.add_row(label, *land(config, used, gains).cells())
    return table


def _table(*labels: str, title: str) -> Table:
    return new_table(
        len(labels), *labels, "landed", "95 %", "force, N", "failed", "us", title=title
    )


if __name__ == "__main__":
    guarded(lambda: run(parse(WrenchOptions, sys.argv[1:])))
