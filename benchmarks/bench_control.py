"""Time the controllers' ticks and the nominal episodes.

Prints medians over many runs on one core: the split of the control tick from estimated
state to joint command, and how much faster than real time the episode runs.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_control.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from icub_jump_env.config import ControllerName, JumpConfig
from icub_jump_env.control.qp import check_solution
from icub_jump_env.control.solvers import SolverName, make_solver
from icub_jump_env.control.torque import TorqueController
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.evaluation.rollout import make_env, run_episode, traced
from icub_jump_env.reference.com_reference import ComReference
from icub_jump_env.reference.com_trajectory import plan_com_trajectory
from icub_jump_env.robot import facts
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model

Sample = tuple[float, np.ndarray, np.ndarray]


def samples_of(controller: ControllerName, count: int) -> list[Sample]:
    """Time and encoder readings along the nominal launch."""
    env = make_env(traced(JumpConfig(controller=controller)))
    trace = run_episode(env, seed=0, trace=True).trace
    env.close()
    launch = [(s.time, s.joint_position, s.joint_velocity) for s in trace if s.phase == "launch"]
    return [launch[i % len(launch)] for i in range(count)]


def median_us(call: Callable[[Sample], object], samples: list[Sample]) -> float:
    """Median duration of ``call`` over the samples (us)."""
    durations = []
    for sample in samples:
        start = time.perf_counter_ns()
        call(sample)
        durations.append(time.perf_counter_ns() - start)
    return float(np.median(durations)) / 1e3


def bench_tick(name: ControllerName, solver: SolverName, count: int) -> None:
    """Print the split of one control tick."""
    model = build_pinocchio_model()
    limits = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    kinematics = FeetFixedKinematics()
    estimator = FeetFixedEstimator(kinematics)
    samples = samples_of(name, count)
    estimator.update(*samples[0][1:])
    reference = ComReference()
    reference.reset(plan_com_trajectory(0.04), estimator.com)
    split: dict[str, Callable[[Sample], object]] = {}
    controller: VelocityController | TorqueController
    if name == "torque":
        dynamics = FeetFixedDynamics(kinematics)
        holding = np.zeros(facts.N_JOINTS)
        controller = TorqueController(facts.CROUCH, holding, limits, dynamics, solver=solver)
        split["dynamics (Pinocchio)"] = lambda s: dynamics.update(s[1], s[2])
        split["pose the QP"] = lambda s: (
            controller._pose_cost(estimator, s[1], s[2], reference),
            controller._pose_constraints(estimator, s[1], s[2]),
        )
    else:
        controller = VelocityController(facts.CROUCH, limits, 0.005, solver=solver)
        split["pose the QP"] = lambda s: controller._pose(
            estimator, s[1], reference.position, reference.velocity
        )

    before, durations = [], []
    for now, s, s_dot in samples:
        start = time.perf_counter_ns()
        estimator.update(s, s_dot)
        reference.update(now)
        estimated = time.perf_counter_ns()
        controller.command(estimator, s, s_dot, reference)
        durations.append((time.perf_counter_ns() - estimated) / 1e3)
        before.append((estimated - start) / 1e3)

    problem = controller.problem
    alone = make_solver(solver, problem)
    solution = alone.solve()
    split[f"solve ({solver})"] = lambda _: alone.solve()
    split["check the solution"] = lambda _: check_solution(problem, solution)
    whole = float(np.median(durations))
    print(
        f"{name} tick with {solver}, from estimated state to joint command: {whole:.1f} us, "
        f"median of {count}"
    )
    remainder = whole
    for part, call in split.items():
        duration = median_us(call, samples)
        remainder -= duration
        print(f"  {part:24s} {duration:7.1f} us")
    print(f"  {'the rest':24s} {remainder:7.1f} us")
    print(f"  before it: estimate and CoM reference {np.median(before):.1f} us")


def bench_episode(name: ControllerName, repetitions: int) -> None:
    """Print how much faster than real time the nominal episode runs."""
    env = make_env(JumpConfig(controller=name))
    factors = []
    for seed in range(repetitions):
        start = time.perf_counter()
        episode = run_episode(env, seed)
        wall = time.perf_counter() - start
        flown = episode.jump["takeoff_time"] + episode.jump["flight_time"]
        factors.append((flown + env.config.stand_time) / wall)
    env.close()
    print(
        f"nominal episode, {name} controller, 1 ms: {np.median(factors):.1f} x real time, "
        f"median of {repetitions} (reset included)"
    )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=2000)
    parser.add_argument("--episodes", type=int, default=11)
    arguments = parser.parse_args()
    for solver in ("daqp", "osqp"):
        for controller in ("velocity", "torque"):
            bench_tick(controller, solver, arguments.ticks)
    for controller in ("velocity", "torque"):
        bench_episode(controller, arguments.episodes)


if __name__ == "__main__":
    main()
