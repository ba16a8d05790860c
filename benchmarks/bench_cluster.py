"""Time a Ray cluster against local processes, and say what a million jumps cost.

Starts a cluster of one node on this machine, with all of its processors. Needs the extra
'cluster' and a machine that does nothing else.

    python benchmarks/bench_cluster.py
"""

from __future__ import annotations

import argparse
import copy
import multiprocessing
import os
import pickle
import tempfile
import time
import tracemalloc
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from functools import partial
from pathlib import Path
from statistics import median

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.cluster import Cluster, Jobs, Slot
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.parallel import Job, run_jobs
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode

JUMP = JumpConfig(randomization="hard")

MILLION = 1_000_000
CORES = (1, 16, 256)


def bench_jumps(jobs: Jobs, workers: int, episodes: int) -> tuple[float, float]:
    """How long the first jump takes (s), and what the workers do from then on (jumps/s each)."""
    start = time.perf_counter()
    ends = [
        time.perf_counter() for _ in run_jobs([Job(JUMP, seed) for seed in range(episodes)], jobs)
    ]
    # As many as there are workers come with the first.
    rest = ends[workers:]
    return ends[0] - start, len(rest) / (rest[-1] - ends[workers - 1]) / workers


def jump_by_itself(seed: int) -> Episode:
    """An episode with an environment of its own."""
    return run_episode(make_env(JUMP), seed)


def bench_plain_pool(workers: int) -> float:
    """How long the first jump takes (s) in a pool that does nothing else."""
    start, context = time.perf_counter(), multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context) as pool:
        wait([pool.submit(jump_by_itself, seed) for seed in range(workers)], None, FIRST_COMPLETED)
        return time.perf_counter() - start


def bench_asking(episode: Episode, slots: int, requests: int) -> tuple[float, float]:
    """What the process that asks can hand out, take in and log (1/s), and the log of one (bytes)."""
    answering = [Slot(partial(partial, copy.copy)) for _ in range(slots)]
    with tempfile.TemporaryDirectory() as folder:
        log = EpisodeLog(Path(folder) / "log.jsonl", {"episodes": 1}, resume=False)
        header = log.path.stat().st_size
        for slot in answering:
            slot.send(episode)
        handled, start = 0, time.perf_counter()
        while handled < requests:
            for slot in Slot.wait_for_any(answering):
                log.append(slot.recv())
                slot.send(episode)
                handled += 1
        rate = handled / (time.perf_counter() - start)
        size = (log.path.stat().st_size - header) / handled
    for slot in answering:
        slot.give_up()
    return rate, size


def memory(episode: Episode) -> float:
    """What an episode takes in memory (bytes)."""
    content, count = pickle.dumps(episode), 1000
    tracemalloc.start()
    kept = [pickle.loads(content) for _ in range(count)]
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return size / len(kept)


def bench(repetitions: int, episodes: int) -> None:
    """Print all of it."""
    import ray
    from ray.cluster_utils import Cluster as LocalCluster

    workers = os.cpu_count() or 1
    nodes = LocalCluster(
        initialize_head=True, head_node_args={"num_cpus": workers, "include_dashboard": False}
    )
    cluster = Cluster(nodes.address)
    ((_, episode),) = run_jobs([Job(JUMP, 0)], 1)
    firsts: dict[str, list[float]] = {"local processes": [], "a running cluster": []}
    rates: dict[str, list[float]] = {name: [] for name in firsts}
    plain: list[float] = []
    for _ in range(repetitions):
        for name, jobs in zip(firsts, (workers, cluster), strict=True):
            first, rate = bench_jumps(jobs, workers, episodes)
            firsts[name].append(first)
            rates[name].append(rate)
            ray.shutdown()  # the next repetition joins anew, with new processes
        plain.append(bench_plain_pool(workers))
    cluster.connect()
    asking = [
        bench_asking(episode, slots=2 * CORES[-1], requests=5000) for _ in range(repetitions)
    ]
    most, size = (median(column) for column in zip(*asking, strict=True))
    ray.shutdown()
    nodes.shutdown()

    print(f"{workers} processors, medians of {repetitions} runs of {episodes} jumps (hard)\n")
    print(f"{'':20s} {'first jump, s':>14s} {'then, jumps/s and processor':>28s}")
    print(f"{'a plain pool':20s} {median(plain):14.1f}")
    for name in firsts:
        print(f"{name:20s} {median(firsts[name]):14.1f} {median(rates[name]):28.2f}")
    print(f"\nthe process that asks hands out, takes in and logs at most {most:.0f} jumps/s;")
    print(
        f"each takes {size / 1e3:.1f} kB of its disk and {memory(episode) / 1e3:.0f} kB of its memory"
    )
    print("\na million jumps on a cluster of such processors")
    for cores in CORES:
        rate = min(cores * median(rates["a running cluster"]), most)
        hours = (median(firsts["a running cluster"]) + MILLION / rate) / 3600
        print(f"{cores:5d} {'processor' if cores == 1 else 'processors':10s} {hours:8.1f} h")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=60)
    arguments = parser.parse_args()
    bench(arguments.repetitions, arguments.episodes)


if __name__ == "__main__":
    main()
