"""Time the control tick and whole episodes of two checkouts in turn, on one core.

One process for each checkout; they take turns, an episode each, so that a noisy machine
disturbs both alike. A control tick is everything from sensor readings to joint command.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/compare_ticks.py ../before .
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def serve(controller: str) -> None:
    """Time an episode for each line that comes in; in the checkout that Python finds."""
    import gymnasium

    import icub_jump_env
    from icub_jump_env.control.jump import JumpController
    from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator

    durations: list[float] = []
    estimates: list[float] = []

    def timed(method: Callable[..., Any], notes: list[float]) -> Callable[..., Any]:
        def wrapper(*arguments: Any) -> Any:
            start = time.perf_counter_ns()
            result = method(*arguments)
            notes.append((time.perf_counter_ns() - start) / 1e3)
            return result

        return wrapper

    estimate = "estimate" if hasattr(FeetFixedEstimator, "estimate") else "update"
    original = getattr(FeetFixedEstimator, estimate)
    setattr(FeetFixedEstimator, estimate, timed(original, estimates))
    JumpController.tick = timed(JumpController.tick, durations)  # type: ignore[method-assign]
    env = gymnasium.make(icub_jump_env.ENV_ID, controller=controller, stand_time=0.3).unwrapped
    action = np.zeros(3, np.float32)
    for _ in sys.stdin:
        env.reset(seed=0)
        durations.clear()
        estimates.clear()
        start, ended = time.perf_counter(), False
        launch = 0
        while not ended:
            *_, ended, _, info = env.step(action)
            if info["phase"] == "launch":
                launch = len(durations)
        wall = 1e3 * (time.perf_counter() - start)
        tick = np.median(durations[:launch]) + np.median(estimates[:launch])
        print(tick, wall, flush=True)


def compare(before: Path, after: Path, controller: str, rounds: int) -> None:
    """Print the medians of both and of their ratios."""
    workers = [
        subprocess.Popen(
            [sys.executable, __file__, "--serve", controller],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for folder in (before.resolve(), after.resolve())
    ]
    rows = []
    for _ in range(rounds + 1):
        row = []
        for worker in workers:
            assert worker.stdin is not None
            assert worker.stdout is not None
            worker.stdin.write("\n")
            worker.stdin.flush()
            row.append([float(word) for word in worker.stdout.readline().split()])
        rows.append(row)
    for worker in workers:
        worker.communicate()
    values = np.array(rows[1:])  # the first round warms up
    for index, (what, unit) in enumerate((("launch tick", "us"), ("episode", "ms"))):
        old, new = values[:, 0, index], values[:, 1, index]
        low, middle, high = np.percentile(new / old, [10, 50, 90])
        print(
            f"{controller}, {what}: before {np.median(old):.1f} {unit}, after "
            f"{np.median(new):.1f} {unit}; ratio {middle:.3f} (10 to 90 %: {low:.3f} to {high:.3f})"
        )


def main() -> None:
    """Compare two checkouts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkouts", type=Path, nargs="*", help="before, after")
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve is not None:
        serve(arguments.serve)
        return
    if len(arguments.checkouts) != 2:
        parser.error("two checkouts, please: before and after")
    for controller in ("velocity", "torque"):
        compare(*arguments.checkouts, controller, arguments.rounds)


if __name__ == "__main__":
    main()
