"""Time the velocity controller's tick and the nominal episode.

Prints medians over many runs on one core: the split of the control tick from estimated
state to joint command, and how much faster than real time the episode runs.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_velocity.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.qp import check_solution
from icub_jump_env.control.solvers import SOLVERS, make_solver
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.evaluation.rollout import make_env, run_episode
from icub_jump_env.robot import facts
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model

Tick = Callable[[], object]


def states(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Encoder readings along the nominal launch."""
    config = JumpConfig(agent_frequency=200.0)
    env = make_env(config)
    trace = run_episode(env, seed=0, trace=True).trace
    env.close()
    launch = [(s.joint_position, s.joint_velocity) for s in trace if s.phase == "launch"]
    return [launch[i % len(launch)] for i in range(count)]


def median_us(call: Callable[[tuple[np.ndarray, np.ndarray]], object], samples: list) -> float:
    """Median duration of ``call`` over the samples (us)."""
    durations = []
    for sample in samples:
        start = time.perf_counter_ns()
        call(sample)
        durations.append(time.perf_counter_ns() - start)
    return float(np.median(durations)) / 1e3


def bench_tick(solver: str, count: int) -> None:
    """Print the split of one control tick."""
    model = build_pinocchio_model()
    limits = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    estimator = FeetFixedEstimator(FeetFixedKinematics())
    controller = VelocityController(facts.CROUCH, limits, 0.005, solver=solver)
    samples = states(count)
    position, velocity = np.array([0.02, 0.0, 0.45]), np.array([0.0, 0.0, 0.5])

    def tick(sample: tuple[np.ndarray, np.ndarray]) -> None:
        estimator.update(*sample)
        controller.update(estimator, sample[0], position, velocity)

    problem = controller.problem
    alone = make_solver(solver, problem)
    tick(samples[0])
    solution = alone.solve()
    split = {
        "estimate (Pinocchio)": median_us(lambda s: estimator.update(*s), samples),
        "pose the QP": median_us(
            lambda s: controller._pose(estimator, s[0], position, velocity), samples
        ),
        f"solve ({solver})": median_us(lambda _: alone.solve(), samples),
        "check the solution": median_us(lambda _: check_solution(problem, solution), samples),
    }
    whole = median_us(tick, samples)
    print(f"velocity tick with {solver}: {whole:.1f} us median of {count}")
    for name, duration in split.items():
        print(f"  {name:24s} {duration:7.1f} us")


def bench_episode(repetitions: int) -> None:
    """Print how much faster than real time the nominal episode runs."""
    env = make_env(JumpConfig())
    factors = []
    for seed in range(repetitions):
        start = time.perf_counter()
        episode = run_episode(env, seed)
        wall = time.perf_counter() - start
        simulated = episode.jump["takeoff_time"] + episode.jump["flight_time"]
        factors.append((simulated + env.config.stand_time) / wall)
    env.close()
    print(
        f"nominal episode at 1 ms: {np.median(factors):.1f} x real time, "
        f"median of {repetitions} (reset included)"
    )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=2000)
    parser.add_argument("--episodes", type=int, default=11)
    arguments = parser.parse_args()
    for solver in SOLVERS:
        bench_tick(solver, arguments.ticks)
    bench_episode(arguments.episodes)


if __name__ == "__main__":
    main()
