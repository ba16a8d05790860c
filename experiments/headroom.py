"""Where can a residual win? Before any training, by what constants, a line and hindsight reach.

    python -m experiments.headroom --jobs 2

Each episode is jumped with each action of a grid: in the launch, or in all phases where something
happens after it. The best constant and the best line are chosen on one half of the tuning seeds, and
all arms are compared on the other half. A line moves one axis by a constant and a multiple of the lean
that the IMU feels as the jump begins. Hindsight takes for each episode what succeeds in it: an action
from its beginning on, or one that begins with the push of the launch. It counts an action only if its
neighbour of the same axis succeeds, too, so that luck alone does not.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TUNING
from icub_jump_env.benchmark.worlds import WORLDS
from icub_jump_env.checks import check_choice, check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.evaluation.quantities import CONTROLLERS, PERCENT, seeds
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.lean import lean_of
from icub_jump_env.planning.residual import AXES
from icub_jump_env.simulation.disturbances import PUSH_DURATION
from icub_jump_env.versions import VERSIONS, EnvName

Array = NDArray[np.float32]
Success = NDArray[np.bool_]

REGIMES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "full": {"randomization": "full"},
        "hard": {"randomization": "hard"},
        "disturbed": {"randomization": "disturbed"},
        **{
            name: {"randomization": world, "residual_phases": "all"}
            for name, world in WORLDS.items()
        },
        "5 jumps": {"randomization": "hard", "jumps": 5, "residual_phases": "all"},
    }
)
"""Worlds, and how often the robot jumps."""

GRID: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {
        "forward": (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8),
        "lateral": (-1.0, -0.5, 0.0, 0.5, 1.0),
        "vertical": (-1.0, -0.5, 0.0, 0.5),
        "roll": (-1.0, -0.5, 0.0, 0.5, 1.0),
        "pitch": (-1.0, -0.5, 0.0, 0.5, 1.0),
    }
)
"""Constant actions, one axis at a time."""

LINES: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...] = (
    ("forward", (0.0, 0.2, 0.4), (-4.0, -2.0, 2.0, 4.0)),
    ("pitch", (0.0, 0.15), (-3.0, -2.0, -1.0, 2.0)),
    ("lateral", (0.0,), (-6.0, -3.0, 3.0, 6.0)),
    ("roll", (0.0,), (-3.0, 3.0)),
)
"""Axis, actions without lean, and actions per lean (1/rad): forward, or to the left."""


@dataclass(frozen=True)
class Shift:
    """A constant action from a time of the jump on.

    Attributes:
        action: Of each axis.
        start: When it begins (s).
    """

    action: tuple[float, ...]
    start: float = 0.0

    def __call__(self, observation: Array) -> Array:
        """The action for an observation."""
        time = float(observation[DEFAULT.slices["time"].start])
        return np.array(self.action, np.float32) * np.float32(time >= self.start)


@dataclass(frozen=True)
class Start:
    """What an episode begins with.

    Attributes:
        lean: That the IMU feels, forward and to the left (rad).
        push: When the push of the launch begins (s).
    """

    lean: tuple[float, float]
    push: float


@dataclass(frozen=True)
class HeadroomOptions:
    """Measure where a residual could win.

    Attributes:
        jobs: Processes that work in parallel.
        episodes: Of each half, at most 100.
        env: The version of the environment.
        regimes: Which of them; by default all.
    """

    jobs: int = 1
    episodes: int = 60
    env: EnvName = "ICubJump-v1"
    regimes: tuple[str, ...] = tuple(REGIMES)

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")
        check_count("episodes", self.episodes, 2, len(TUNING) // 2)
        check_choice("env", self.env, tuple(VERSIONS))
        for regime in self.regimes:
            check_choice("regimes", regime, tuple(REGIMES))


def configuration(
    env: EnvName, regime: str, controller: ControllerName, lean_correction: bool
) -> JumpConfig:
    """The jumps of a regime, 4 to 6 cm."""
    displacement = {"com_displacement": 0.09} if env == "ICubJump-v0" else {}
    together = {
        **VERSIONS[env],
        **displacement,
        **REGIMES[regime],
        "controller": controller,
        "jump_height": (0.04, 0.06),
        "residual_axes": AXES,
        "early_end": True,
        "lean_correction": lean_correction,
    }
    return JumpConfig.of(**together)


def starts(config: JumpConfig, of_seeds: Sequence[int]) -> list[Start]:
    """What episodes begin with."""
    env, found = make_env(config), []
    for seed in of_seeds:
        _, info = env.reset(seed=seed)
        plan, readings = env._controller.plan, env._simulation.sensors.readings
        forward, left = lean_of(readings.gravity, plan.stance)
        push = info["world"]["push_time"] * (plan.duration - PUSH_DURATION)
        found.append(Start((float(forward), float(left)), push))
    env.close()
    return found


class Line(NamedTuple):
    """What moves one axis: a constant, or a line over the lean.

    Attributes:
        axis: That it moves.
        offset: Action without lean.
        gain: Action per lean forward, or to the left for the axes across (1/rad).
        after_push: Whether it begins with the push of the launch only.
    """

    axis: str
    offset: float
    gain: float = 0.0
    after_push: bool = False

    def policy(self, start: Start) -> Shift:
        """It in an episode."""
        lean = start.lean[self.axis in ("lateral", "roll")]
        action = min(max(self.offset + self.gain * lean, -1.0), 1.0)
        actions = tuple(action if axis == self.axis else 0.0 for axis in AXES)
        return Shift(actions, start.push if self.after_push else 0.0)


ZERO = Line("forward", 0.0)


def constants(after_push: bool = False) -> list[Line]:
    """The grid of actions."""
    return [
        Line(axis, value, after_push=after_push)
        for axis, values in GRID.items()
        for value in values
    ]


def lines() -> list[Line]:
    """The lines over the lean that are tried."""
    return [
        Line(axis, *pair)
        for axis, offsets, gains in LINES
        for pair in itertools.product(offsets, gains)
    ]


def robust(success: Mapping[Line, Success]) -> Success:
    """Of each episode whether an action and its neighbour of the same axis succeed."""
    pairs = [
        success[one] & success[other]
        for one, other in itertools.pairwise(success)
        if one.axis == other.axis
    ]
    found: Success = np.any(pairs, axis=0)
    return found


def measure(config: JumpConfig, episodes: int, jobs: int, progress: Console) -> dict[str, Any]:
    """Success of each arm on the second half of the seeds, and what was chosen on the first.

    Hindsight plays only where the zero action fails: elsewhere it has nothing to win.
    """
    both = TUNING[: 2 * episodes]
    first, second = both[0::2], both[1::2]
    begun = dict(zip(both, starts(config, both), strict=True))

    def play(lines: Sequence[Line], on: Sequence[int]) -> dict[Line, Success]:
        same = {line: line if line.offset or line.gain else ZERO for line in lines}
        tried = list(dict.fromkeys(same.values()))
        work = [Job(config, seed, line.policy(begun[seed])) for line in tried for seed in on]
        played = np.array([each.is_success for each in run_all(work, jobs, progress)], bool)
        found = dict(zip(tried, played.reshape(len(tried), len(on)), strict=True))
        return {line: found[as_played] for line, as_played in same.items()}

    def best(lines: Sequence[Line]) -> Line:
        if play([ZERO], first)[ZERO].all():
            return ZERO
        success = play(lines, first)
        return max(lines, key=lambda line: (success[line].mean(), -abs(line.offset)))

    constant, line = best(constants()), best(lines())
    success = play([ZERO, constant, line], second)
    zero = success[ZERO]
    lost = [seed for seed, succeeds in zip(second, zero, strict=True) if not succeeds]
    saved = {}
    for name, after_push in (("hindsight", False), ("after the push", True)):
        saved[name] = zero.copy()
        saved[name][~zero] = robust(play(constants(after_push), lost))
    return {
        "zero": zero,
        "constant": success[constant],
        "line": success[line],
        **saved,
        "chosen constant": constant,
        "chosen line": line,
    }


def render(
    options: HeadroomOptions, results: Mapping[tuple[str, ControllerName], dict[str, Any]]
) -> Table:
    """The table of a version."""
    table = new_table(
        2, "regime", "controller", "zero", "constant", "", "line", "", "hindsight",
        "after the push",
        title=f"Success, %, {options.env}, 4 to 6 cm, {seeds(TUNING[: 2 * options.episodes])}, every other",
    )  # fmt: skip
    for (regime, controller), found in results.items():
        constant, line = found["chosen constant"], found["chosen line"]
        percent = {
            name: f"{PERCENT * np.mean(values):.0f}"
            for name, values in found.items()
            if not name.startswith("chosen")
        }
        table.add_row(
            regime, controller, percent["zero"],
            percent["constant"], "zero" if constant == ZERO else f"{constant.axis} {constant.offset:+g}",
            percent["line"], "zero" if line == ZERO else f"{line.axis} {line.offset:+g} {line.gain:+g} lean",
            percent["hindsight"], percent["after the push"],
        )  # fmt: skip
    return table


def run(options: HeadroomOptions) -> None:
    """Measure and print."""
    console, progress = Console(), Console(stderr=True)
    results = {}
    for regime, controller in itertools.product(options.regimes, CONTROLLERS):
        config = configuration(options.env, regime, controller, lean_correction=False)
        results[regime, controller] = measure(config, options.episodes, options.jobs, progress)
    show(console, render(options, results))


if __name__ == "__main__":
    guarded(lambda: run(parse(HeadroomOptions, sys.argv[1:])))
