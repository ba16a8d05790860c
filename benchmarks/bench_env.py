"""Time the environment: steps per second, and where the time goes.

Runs randomised episodes on one core, as a training does, with a watch around the physics, the
models and the QP.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_env.py
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.simulation.sensors import Sensors
from icub_jump_env.simulation.simulation import Simulation

PARTS = {
    "physics, metrics": (Simulation, "run"),
    "kinematics": (FeetFixedKinematics, "update"),
    "dynamics": (FeetFixedDynamics, "update"),
    "QP, solved and checked": (CheckedSolver, "solve"),
    "sensors": (Sensors, "read"),
}


@contextmanager
def watched(durations: dict[str, float]) -> Iterator[None]:
    """Add up how long each part takes; parts do not contain one another."""
    patches = [
        patch.object(owner, name, _timed(getattr(owner, name), part, durations))
        for part, (owner, name) in PARTS.items()
    ]
    for each in patches:
        each.start()
    try:
        yield
    finally:
        for each in patches:
            each.stop()


def _timed(
    function: Callable[..., Any], part: str, durations: dict[str, float]
) -> Callable[..., Any]:
    def timed(*arguments: Any) -> Any:
        start = time.perf_counter()
        result = function(*arguments)
        durations[part] += time.perf_counter() - start
        return result

    return timed


def run(env: ICubJumpEnv, seed: int, at_takeoff: Callable[[], None]) -> int:
    """One episode of the baseline; returns its number of steps."""
    env.reset(seed=seed)
    zero, launching = np.zeros(3, np.float32), True
    for steps in itertools.count(1):
        *_, ended, _, info = env.step(zero)
        if launching and info["phase"] != "launch":
            launching = False
            at_takeoff()
        if ended:
            return steps
    raise AssertionError  # unreachable: every episode ends


def bench_reset(controller: ControllerName, episodes: int) -> None:
    """Print what a reset costs with whole-body plans, with the same command and with another."""
    env = make_env(JumpConfig(controller=controller, planner="whole_body"))
    durations: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(episodes):
        command = 0.03 + 0.02 * seed / episodes
        for again in (False, True):
            start = time.perf_counter()
            env.reset(seed=seed, options={"jump_height": command})
            durations[again].append(1e3 * (time.perf_counter() - start))
    same, other = np.median(durations[True]), np.median(durations[False])
    print(f"{controller}: reset {same:.1f} ms, with a new whole-body command {other:.1f} ms")


def bench(controller: ControllerName, episodes: int) -> None:
    """Print the throughput, and the shares of the parts in the launch and in all of it."""
    env = make_env(JumpConfig(controller=controller, randomization="hard"))
    rates = []
    for seed in range(episodes):
        start = time.perf_counter()
        steps = run(env, seed, at_takeoff=lambda: None)
        rates.append(steps / (time.perf_counter() - start))
    print(f"{controller}: {np.median(rates):.0f} steps/s, median of {episodes}, resets included")

    durations: dict[str, float] = defaultdict(float)
    shares: dict[str, list[dict[str, float]]] = {"launch": [], "episode": []}

    def note(what: str) -> None:
        wall = time.perf_counter() - start
        parts = {part: durations[part] / wall for part in PARTS}
        shares[what].append(parts | {"the rest, in Python": 1.0 - sum(parts.values())})

    with watched(durations):
        for seed in range(episodes):
            durations.clear()
            start = time.perf_counter()
            run(env, seed, at_takeoff=lambda: note("launch"))
            note("episode")
    env.close()
    print(f"  {'share of the time':24s} {'launch':>8s} {'episode':>8s}")
    for part in shares["episode"][0]:
        launch, episode = (np.median([s[part] for s in shares[what]]) for what in shares)
        print(f"  {part:24s} {launch:8.1%} {episode:8.1%}")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=21)
    arguments = parser.parse_args()
    for controller in ("velocity", "torque"):
        bench_reset(controller, arguments.episodes)
        bench(controller, arguments.episodes)


if __name__ == "__main__":
    main()
