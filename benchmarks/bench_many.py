"""Time several environments at once, by how they are run.

One after the other, in threads of one process, and each in a process of its own: the same steps,
turn by turn. Medians over the rounds.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_many.py
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor

import gymnasium
import numpy as np
import psutil

MODES = {"one by one": "sync", "threads": "vector_entry_point", "processes": "async"}
"""What Gymnasium calls them."""

STEPS = 200
"""Of a round: an episode and the reset after it."""


def make_envs(mode: str, controller: str, num_envs: int) -> gymnasium.vector.VectorEnv:
    """A vector environment at the start of its episodes."""
    envs = gymnasium.make_vec(
        "icub_jump_env:ICubJump-v0",
        num_envs=num_envs,
        vectorization_mode=mode,
        controller=controller,
        randomization="hard",
    )
    envs.reset(seed=0)
    return envs


def memory(mode: str, controller: str, num_envs: int) -> tuple[float, float]:
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


def bench(controller: str, num_envs: int, rounds: int) -> None:
    """Print throughput and memory by how they are run."""
    envs = {way: make_envs(mode, controller, num_envs) for way, mode in MODES.items()}
    rates: dict[str, list[float]] = {way: [] for way in MODES}
    zeros = np.zeros((num_envs, 3), np.float32)
    for _ in range(rounds):
        for way in MODES:
            start = time.perf_counter()
            for _ in range(STEPS):
                envs[way].step(zeros)
            rates[way].append(num_envs * STEPS / (time.perf_counter() - start))
    for each in envs.values():
        each.close()
    print(f"{controller}, {num_envs} {'environment' if num_envs == 1 else 'environments'}, hard")
    # A fresh process for each: none has the others' memory.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, max_tasks_per_child=1) as pool:
        for way, mode in MODES.items():
            resident, proportional = pool.submit(memory, mode, controller, num_envs).result()
            low, high = np.percentile(rates[way], [10, 90])
            print(
                f"  {way:11s} {np.median(rates[way]):5.0f} steps/s ({low:.0f} to {high:.0f})   "
                f"{resident:5.0f} MB resident, {proportional:5.0f} MB with shared pages once"
            )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--num-envs", type=int, nargs="*", default=[1, 2, 4, 8])
    arguments = parser.parse_args()
    print(f"medians of {arguments.rounds} rounds (10 to 90 %) on {os.cpu_count()} processors\n")
    for controller in ("velocity", "torque"):
        for num_envs in arguments.num_envs:
            bench(controller, num_envs, arguments.rounds)


if __name__ == "__main__":
    main()
