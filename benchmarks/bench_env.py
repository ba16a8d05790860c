"""Time the environment: what a step costs beside its physics, and where the time goes.

Whole episodes on one core, without action. The physics are timed in the same jump through
``mujoco.mj_step`` (``physics_loop="python"``, the same bits), the jump itself with the defaults,
turn by turn; Gymnasium's Humanoid-v5, if its extra is there, likewise. Medians over the episodes.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_env.py
"""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import gymnasium
import mujoco
import numpy as np

from icub_jump_env.control.config import TorqueConfig, VelocityConfig
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.simulation.self_collision import SelfCollision
from icub_jump_env.simulation.sensors import Sensors
from icub_jump_env.simulation.simulation import Simulation

Env = gymnasium.Env[Any, Any]
Make = Callable[..., Env]

CONTROLLERS = ("velocity", "torque")
HARD = {"randomization": "hard"}
FAST = {"velocity": VelocityConfig(frequency=1000.0), "torque": TorqueConfig(frequency=1000.0)}
"""With control at 1 kHz."""

PARTS = {
    "physics, metrics": (Simulation, "run"),
    "kinematics": (FeetFixedKinematics, "update"),
    "dynamics": (FeetFixedDynamics, "update"),
    "QP, solved and checked": (CheckedSolver, "solve"),
    "sensors": (Sensors, "read"),
    "links that meet": (SelfCollision, "overlap"),
}


class Played(NamedTuple):
    """An episode: its steps, their wall time (s) and the time simulated (s)."""

    steps: int
    wall: float
    simulated: float


def play(env: Env, seed: int, started: Callable[[], None] = lambda: None) -> Played:
    """Play an episode without action; ``started`` is called after the reset."""
    env.reset(seed=seed)
    zero = np.zeros(env.action_space.shape or (), np.float32)
    started()
    start = time.perf_counter()
    steps, over = 0, False
    while not over:
        _, _, terminated, truncated, _ = env.step(zero)
        steps, over = steps + 1, terminated or truncated
    return Played(steps, time.perf_counter() - start, float(env.unwrapped.data.time))


@contextlib.contextmanager
def timed(owner: Any, name: str, note: Callable[[float], None]) -> Iterator[None]:
    """Note how long each call of a function takes (s)."""
    function = getattr(owner, name)

    def call(*arguments: Any, **others: Any) -> Any:
        start = time.perf_counter()
        result = function(*arguments, **others)
        note(time.perf_counter() - start)
        return result

    with patch.object(owner, name, call):
        yield


def physics_of(env: Env, seed: int) -> float:
    """Time in ``mujoco.mj_step`` (s) in an episode that calls it."""
    durations: list[float] = []
    with timed(mujoco, "mj_step", durations.append):
        play(env, seed, started=durations.clear)
    return sum(durations)


def ours(through_python: bool, **config: Any) -> Env:
    """One of our environments; ``config`` may name another version than v0."""
    name = config.pop("name", "ICubJump-v0")
    loop = "python" if through_python else "compiled"
    return gymnasium.make(name, physics_loop=loop, **config)


def bench_step(what: str, make: Make, episodes: int) -> None:
    """Print a line: rate, and the step beside its physics."""
    env, observed = make(through_python=False), make(through_python=True)
    play(env, 0), play(observed, 0)  # whatever happens once
    found = []
    for seed in range(episodes):
        played, physics = play(env, seed), physics_of(observed, seed)
        found.append(
            (played.steps / played.wall, played.simulated / played.wall, played.wall / physics)
        )
    rate, real_time, ratio = np.median(found, axis=0)
    low, high = np.percentile([each[2] for each in found], [10, 90])
    print(f"{what:24s} {rate:8.0f} {real_time:10.1f} {ratio:12.2f}   {low:.2f} to {high:.2f}")


def bench_parts(controller: str, episodes: int) -> None:
    """Print the shares of the parts, which do not contain one another, in a jump."""
    env = ours(False, controller=controller, **HARD)
    play(env, 0)
    shares = []
    for seed in range(episodes):
        durations: dict[str, float] = defaultdict(float)

        def add(part: str, duration: float, durations: dict[str, float] = durations) -> None:
            durations[part] += duration

        with contextlib.ExitStack() as stack:
            for part, (owner, name) in PARTS.items():
                stack.enter_context(timed(owner, name, partial(add, part)))
            wall = play(env, seed, started=durations.clear).wall
        shares.append([durations[part] / wall for part in PARTS])
    print(f"\n{controller}, hard, share of the time")
    for part, share in zip(PARTS, np.median(shares, axis=0), strict=True):
        print(f"  {part:24s} {share:6.1%}")
    print(f"  {'the rest':24s} {1.0 - np.median(np.sum(shares, axis=1)):6.1%}")


def milliseconds(calls: int, call: Callable[[int], object]) -> float:
    """How long a call takes that is given its number, the median of several (ms)."""
    durations = []
    for number in range(calls):
        start = time.perf_counter()
        call(number)
        durations.append(1e3 * (time.perf_counter() - start))
    return float(np.median(durations))


def bench_import(calls: int) -> None:
    """Print how long a new process takes to import the package, and to its first episode."""

    def python(code: str) -> float:
        command = [sys.executable, "-c", code]
        return milliseconds(calls, lambda _: subprocess.run(command, check=True))

    bare = python("pass")
    package, theirs = python("import icub_jump_env") - bare, python("import gymnasium") - bare
    first = python("import gymnasium; gymnasium.make('icub_jump_env:ICubJump-v1').reset()") - bare
    print(
        f"\nimport: {package:.0f} ms, of which gymnasium {theirs:.0f} ms; "
        f"to the first episode: {first:.0f} ms"
    )


def bench_start(controller: str, calls: int) -> None:
    """Print how long construction and resets take."""
    make = partial(ours, False, controller=controller)
    same, worlds, plans = make(), make(**HARD), make(name="ICubJump-v1")
    for env in (same, worlds, plans):
        env.reset(seed=0)

    def another_height(number: int) -> None:
        plans.reset(seed=0, options={"jump_height": 0.03 + 0.02 * number / calls})

    found = {
        "construction": lambda _: make(),
        "reset": lambda seed: same.reset(seed=seed),
        "hard": lambda seed: worlds.reset(seed=seed),
        "v1, another height": another_height,
    }
    told = [f"{what} {milliseconds(calls, call):.1f} ms" for what, call in found.items()]
    print(f"{controller}: {', '.join(told)}")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--episodes", type=int, default=21)
    episodes = parser.parse_args().episodes
    print(f"medians of {episodes} episodes\n")
    print(f"{'':24s}  steps/s  real time  its mj_steps   10 to 90 %")
    for controller in CONTROLLERS:
        cases = {
            "": {},
            ", hard": HARD,
            ", v1, hard": {"name": "ICubJump-v1", **HARD},
            ", 1 kHz, 0.5 ms": {"timestep": 0.0005, "controller": FAST[controller]},
        }
        for what, config in cases.items():
            make = partial(ours, **{"controller": controller, **config})
            bench_step(controller + what, make, episodes)
    try:
        bench_step("Humanoid-v5", lambda through_python: gymnasium.make("Humanoid-v5"), episodes)
    except ImportError as error:
        print(f"Humanoid-v5 skipped: {error}")
    for controller in CONTROLLERS:
        bench_parts(controller, episodes)
    bench_import(episodes)
    for controller in CONTROLLERS:
        bench_start(controller, episodes)


if __name__ == "__main__":
    main()
