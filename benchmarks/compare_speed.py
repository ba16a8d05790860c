"""Time control ticks, episodes and training episodes of two checkouts in turn, on one core.

One process for each checkout; they take turns, an episode each, so that a noisy machine
disturbs both alike. Prints medians of the ratios, after to before. A control tick is everything
from sensor readings to joint command, in the launch; limits are active where the closed form of
the QP does not do in the checkout after. A training episode has actions that fell about half of
the robots (noise of 0.6 around zero), and takes a reset with it.

    git worktree add ../before COMMIT
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/compare_speed.py ../before .
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

HARD = {"randomization": "hard"}
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "episode": ("ICubJump-v0", {}),
    "episode, hard": ("ICubJump-v0", HARD),
    "episode, v1": ("ICubJump-v1", {}),
    "episode, v1, hard": ("ICubJump-v1", HARD),
    "episode, 1 kHz, 0.5 ms": ("ICubJump-v0", {"control_frequency": 1000.0, "timestep": 0.0005}),
    "training episode": ("training", {}),
}


def timed(owner: Any, name: str, notes: list[float]) -> None:
    """Note from now on how long each call of a method takes (us)."""
    method: Callable[..., Any] = getattr(owner, name)

    def call(*arguments: Any) -> Any:
        start = time.perf_counter_ns()
        result = method(*arguments)
        notes.append((time.perf_counter_ns() - start) / 1e3)
        return result

    setattr(owner, name, call)


def play(env: Any, seed: int, noise: float = 0.0) -> float:
    """Play an episode and return how long it took (ms)."""
    rng, ended = np.random.default_rng(seed), False
    start = time.perf_counter()
    env.reset(seed=seed)
    while not ended:
        action = noise * rng.normal(size=env.action_space.shape)
        _, _, ended, _, _ = env.step(action.astype(np.float32))
    return 1e3 * (time.perf_counter() - start)


def serve(what: str, controller: str) -> None:
    """Time an episode for each seed that comes in; in the checkout that Python finds."""
    import gymnasium

    import icub_jump_env  # noqa: F401

    name, keywords = CASES.get(what, ("ICubJump-v0", {}))
    noise, ticks, estimates, active = 0.0, [], [], []
    if name == "training":
        from agents.environment import LaunchEnv
        from agents.options import TASK, TrainOptions

        options = TrainOptions(env=TASK.replace(controller=controller))
        env, noise = LaunchEnv(options.env, options.input_names, options.axes), 0.6
    else:
        env = gymnasium.make(name, controller=controller, **keywords).unwrapped
    if what not in CASES:
        from icub_jump_env.control.jump import JumpController
        from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator

        tick = JumpController.tick

        def noted(*arguments: Any) -> Any:
            result = tick(*arguments)
            # The launch alone has a QP.
            active.append(result.report and result.report.iterations > 0)
            return result

        if what == "which":
            JumpController.tick = noted  # type: ignore[method-assign]
        else:
            timed(JumpController, "tick", ticks)
            timed(FeetFixedEstimator, "estimate", estimates)
    for line in sys.stdin:
        for notes in (ticks, estimates, active):
            notes.clear()
        wall = play(env, int(line), noise)
        both = [a + b for a, b in zip(ticks, estimates, strict=False)]
        print(json.dumps({"wall": wall, "ticks": both, "active": active}), flush=True)


class Worker:
    """A process that plays episodes with one checkout."""

    def __init__(self, folder: Path, what: str, controller: str) -> None:
        command = [sys.executable, __file__, "--serve", what, controller]
        self._process = subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def play(self, seed: int) -> dict[str, Any]:
        """Play an episode and return what it took."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{seed}\n")
        self._process.stdin.flush()
        found: dict[str, Any] = json.loads(self._process.stdout.readline())
        return found

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def compare(folders: list[Path], what: str, controller: str, rounds: int) -> list[list[Any]]:
    """Play in turn; what each took in each round, (rounds, 2)."""
    workers = [Worker(folder, what, controller) for folder in folders]
    for worker in workers:
        worker.play(0)
    found = [[worker.play(seed) for worker in workers] for seed in range(rounds)]
    for worker in workers:
        worker.close()
    return found


def tell(what: str, unit: str, pairs: list[tuple[float, float]]) -> None:
    """Print a line: medians of both, and of the ratios."""
    old, new = np.array(pairs).T
    low, middle, high = np.percentile(new / old, [10, 50, 90])
    print(
        f"{what:34s} {np.median(old):8.1f} {np.median(new):8.1f} {unit}   "
        f"{middle:.3f}   {low:.3f} to {high:.3f}   {1.0 / middle:.2f}",
        flush=True,
    )


def main() -> None:
    """Compare two checkouts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkouts", type=Path, nargs="*", help="before, after")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--serve", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve is not None:
        serve(*arguments.serve)
        return
    if len(arguments.checkouts) != 2:
        parser.error("two checkouts, please: before and after")
    folders, rounds = [folder.resolve() for folder in arguments.checkouts], arguments.rounds
    print(f"medians of {rounds} rounds\n")
    print(f"{'':34s}   before    after        ratio   10 to 90 %        times as fast")
    for controller in ("velocity", "torque"):
        which = Worker(folders[1], "which", controller)
        active = [bool(each) for each in which.play(0)["active"] if each is not None]
        which.close()
        found = compare(folders, "tick", controller, rounds)
        for limits, wanted in (("inactive", False), ("active", True)):
            chosen = [tick for tick, each in enumerate(active) if each is wanted]
            pairs = [
                tuple(float(np.median(np.take(of["ticks"], chosen))) for of in both)
                for both in found
            ]
            tell(f"{controller}, tick, limits {limits}", "us", pairs)
        for what in CASES:
            found = compare(folders, what, controller, rounds)
            tell(f"{controller}, {what}", "ms", [(old["wall"], new["wall"]) for old, new in found])


if __name__ == "__main__":
    main()
