"""Where can a residual win? Before any training, by what constants, a line and hindsight reach.

    python -m experiments.headroom --jobs 2

Each episode is jumped with each action of a grid: in the launch, or in all phases where something
happens after it. The best constant and the best law are chosen on one half of the tuning seeds, and
all arms are compared on the other half. A law moves one axis by a constant and a multiple of the lean
that the IMU feels as the jump begins. Hindsight takes for each episode what succeeds in it: an action
from its beginning on, or one that begins with the push of the launch. It counts an action only if its
neighbour of the same axis succeeds, too, so that luck alone does not.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TUNING
from icub_jump_env.checks import check_choice, check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.parallel import Job, run_all
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.evaluation.quantities import CONTROLLERS, seeds
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.lean import lean_of
from icub_jump_env.planning.residual import AXES
from icub_jump_env.simulation.disturbances import PUSH_DURATION
from icub_jump_env.simulation.randomization import RANDOMIZATIONS
from icub_jump_env.versions import VERSIONS, EnvName

Array = NDArray[np.float32]

HARD, DEG = RANDOMIZATIONS["hard"], math.radians(1.0)

REGIMES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "full": {"randomization": "full"},
        "hard": {"randomization": "hard"},
        "disturbed": {"randomization": "disturbed"},
        "pushed": {
            "randomization": replace(
                HARD,
                push=(-6.0, 6.0),
                flight_push=(-6.0, 6.0),
                landing_push=(-8.0, 8.0),
                landing_push_time=(0.1, 0.8),
            ),
            "residual_phases": "all",
        },
        "lateral": {
            "randomization": replace(
                HARD,
                lateral_slope=(-3.0 * DEG, 3.0 * DEG),
                push=(-6.0, 6.0),
                push_direction=(math.pi / 2, math.pi / 2),
                landing_push=(-8.0, 8.0),
                landing_push_direction=(math.pi / 2, math.pi / 2),
            ),
            "residual_phases": "all",
        },
        "landing": {
            "randomization": replace(
                HARD,
                takeoff_spin=(-0.2, 0.2),
                floor_tilt=(-5.0 * DEG, 5.0 * DEG),
                floor_tilt_lateral=(-3.0 * DEG, 3.0 * DEG),
                edge=(-0.02, 0.02),
                step=(0.0, 0.02),
            ),
            "residual_phases": "all",
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

LAWS: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...] = (
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


def one(axis: str, value: float) -> tuple[float, ...]:
    """An action along one axis."""
    return tuple(value if name == axis else 0.0 for name in AXES)


def constants() -> dict[tuple[str, float], tuple[float, ...]]:
    """The grid of actions."""
    return {(axis, value): one(axis, value) for axis, values in GRID.items() for value in values}


def laws() -> list[tuple[str, float, float]]:
    """Axis, action without lean and gain of each law that is tried."""
    return [
        (axis, *pair)
        for axis, offsets, gains in LAWS
        for pair in itertools.product(offsets, gains)
    ]


def follow(law: tuple[str, float, float], start: Start) -> Shift:
    """The law in an episode."""
    axis, offset, gain = law
    felt = start.lean[0] if axis in ("forward", "pitch") else start.lean[1]
    return Shift(one(axis, min(max(offset + gain * felt, -1.0), 1.0)))


def robust(success: Mapping[tuple[str, float], NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Of each episode whether an action and its neighbour of the same axis succeed."""
    pairs = [
        success[axis, a] & success[axis, b]
        for axis, values in GRID.items()
        for a, b in itertools.pairwise(values)
    ]
    found: NDArray[np.bool_] = np.any(pairs, axis=0)
    return found


def measure(config: JumpConfig, episodes: int, jobs: int, progress: Console) -> dict[str, Any]:
    """Success of each arm on the second half of the seeds, and what was chosen on the first."""
    of_seeds = TUNING[: 2 * episodes]
    begun = starts(config, of_seeds)
    grid, tried = constants(), laws()
    late = {key: action for key, action in grid.items() if key[1] != 0.0}
    policies: list[tuple[Any, list[Shift]]] = [
        *((("constant", key), [Shift(action)] * len(begun)) for key, action in grid.items()),
        *((("law", law), [follow(law, start) for start in begun]) for law in tried),
        *(
            (("late", key), [Shift(action, start.push) for start in begun])
            for key, action in late.items()
        ),
    ]
    work = [
        Job(config, seed, shift)
        for _, shifts in policies
        for seed, shift in zip(of_seeds, shifts, strict=True)
    ]
    played = np.array([each.is_success for each in run_all(work, jobs, progress)])
    success = dict(
        zip([what for what, _ in policies], played.reshape(len(policies), -1), strict=True)
    )
    first, second = slice(0, None, 2), slice(1, None, 2)

    def best(kind: str) -> Any:
        return max((w for w in success if w[0] == kind), key=lambda w: success[w][first].mean())

    zero = success["constant", ("forward", 0.0)]
    constant, law = best("constant"), best("law")
    from_the_start = {key: success["constant", key] for key in grid}
    after = {key: success["late", key] if key in late else zero for key in grid}
    return {
        "zero": zero[second],
        "constant": success[constant][second],
        "chosen constant": constant[1],
        "law": success[law][second],
        "chosen law": law[1],
        "hindsight": (robust(from_the_start) | zero)[second],
        "after the push": (robust(after) | zero)[second],
    }


def render(
    options: HeadroomOptions, results: Mapping[tuple[str, ControllerName], dict[str, Any]]
) -> Table:
    """The table of a version."""
    table = new_table(
        2, "regime", "controller", "zero", "constant", "", "law", "", "hindsight",
        "after the push",
        title=f"Success, %, {options.env}, 4 to 6 cm, {seeds(TUNING[: 2 * options.episodes])}, every other",
    )  # fmt: skip
    for (regime, controller), found in results.items():
        axis, value = found["chosen constant"]
        of, offset, gain = found["chosen law"]
        percent = {
            name: f"{100 * np.mean(values):.0f}"
            for name, values in found.items()
            if not name.startswith("chosen")
        }
        table.add_row(
            regime, controller, percent["zero"],
            percent["constant"], f"{axis} {value:+g}",
            percent["law"], f"{of} {offset:+g} {gain:+g} lean",
            percent["hindsight"], percent["after the push"],
        )  # fmt: skip
    return table


def run(options: HeadroomOptions) -> None:
    """Measure and print."""
    console, progress = Console(), Console(stderr=True)
    results = {}
    for regime, controller in itertools.product(options.regimes, CONTROLLERS):
        displacement = {"com_displacement": 0.09} if options.env == "ICubJump-v0" else {}
        config = JumpConfig.of(
            **VERSIONS[options.env],
            **displacement,
            **REGIMES[regime],
            controller=controller,
            jump_height=(0.04, 0.06),
            residual_axes=AXES,
            early_end=True,
        )
        results[regime, controller] = measure(config, options.episodes, options.jobs, progress)
    show(console, render(options, results))


if __name__ == "__main__":
    guarded(lambda: run(parse(HeadroomOptions, sys.argv[1:])))
