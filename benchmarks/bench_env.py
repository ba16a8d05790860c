"""Time the environment: steps per second, and where the time goes.

Runs randomised episodes on one core, as a training does, with a watch around the physics, the
models and the QP. Then several environments at once: one after the other, in threads, and each in a
process of its own, with the same steps and turn by turn.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_env.py
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import gymnasium
import numpy as np
import psutil

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


MODES = {"one by one": "sync", "threads": "vector_entry_point", "processes": "async"}
"""What Gymnasium calls them."""

VECTOR_STEPS = 200
"""Steps of a round: an episode and the reset after it."""


def make_envs(mode: str, controller: ControllerName, num_envs: int) -> gymnasium.vector.VectorEnv:
    """A vector environment at the start of its episodes."""
    envs = gymnasium.make_vec(
        "ICubJump-v0",
        num_envs=num_envs,
        vectorization_mode=mode,
        controller=controller,
        randomization="hard",
    )
    envs.reset(seed=0)
    return envs


def memory(mode: str, controller: ControllerName, num_envs: int) -> tuple[float, float]:
    """Memory of this process and its children with environments that have made some steps.

    Returns:
        Resident memory, and that without counting twice what processes share (MB).
    """
    envs = make_envs(mode, controller, num_envs)
    for _ in range(10):
        envs.step(np.zeros((num_envs, 3), np.float32))
    this = psutil.Process()
    used = [each.memory_full_info() for each in (this, *this.children(recursive=True))]
    envs.close()
    return sum(each.rss for each in used) / 1e6, sum(each.pss for each in used) / 1e6


def bench_vector(controller: ControllerName, num_envs: int, rounds: int) -> None:
    """Print throughput and memory of several environments, by how they are run."""
    envs = {way: make_envs(mode, controller, num_envs) for way, mode in MODES.items()}
    rates: dict[str, list[float]] = {way: [] for way in MODES}
    zeros = np.zeros((num_envs, 3), np.float32)
    for _ in range(rounds):
        for way in MODES:
            start = time.perf_counter()
            for _ in range(VECTOR_STEPS):
                envs[way].step(zeros)
            rates[way].append(num_envs * VECTOR_STEPS / (time.perf_counter() - start))
    for each in envs.values():
        each.close()
    print(f"{controller}, {num_envs} environments: steps/s, median of {rounds}, resets included")
    # A fresh process for each: none has the others' memory.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, max_tasks_per_child=1) as pool:
        for way, mode in MODES.items():
            resident, proportional = pool.submit(memory, mode, controller, num_envs).result()
            print(
                f"  {way:11s} {np.median(rates[way]):5.0f}   "
                f"{resident:5.0f} MB resident, {proportional:5.0f} MB with shared pages once"
            )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=21)
    parser.add_argument("--num-envs", type=int, nargs="*", default=[2, 8])
    arguments = parser.parse_args()
    for controller in ("velocity", "torque"):
        bench_reset(controller, arguments.episodes)
        bench(controller, arguments.episodes)
        for num_envs in arguments.num_envs:
            bench_vector(controller, num_envs, arguments.episodes)


if __name__ == "__main__":
    main()
