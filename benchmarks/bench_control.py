"""Time the controllers' ticks and the nominal episodes.

Prints medians over many runs on one core: the split of the control tick from estimated
state to joint command, and how much faster than real time the episode runs.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_control.py
"""

from __future__ import annotations

import argparse
import dataclasses
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from time import perf_counter_ns
from typing import Any

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import CONTROLLERS, ControllerName, SolverName, TorqueConfig
from icub_jump_env.control.phases import Tick
from icub_jump_env.control.qp.check import check_solution
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.control.torque import TorqueController
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlan, plan_com_trajectory
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.statics import make_stance
from icub_jump_env.versions import VERSIONS

Sample = tuple[float, np.ndarray, np.ndarray]


def samples_of(controller: ControllerName, count: int) -> list[Sample]:
    """Time and encoder readings along the nominal launch."""
    env = make_env(traced(JumpConfig(controller=controller)))
    trace = run_episode(env, seed=0, trace=True).trace
    env.close()
    launch = [(s.time, s.joint_position, s.joint_velocity) for s in trace if s.phase == "launch"]
    return [launch[i % len(launch)] for i in range(count)]


class Stopwatch:
    """Durations (us) of named parts, over many runs."""

    def __init__(self) -> None:
        self._durations: dict[str, list[float]] = defaultdict(list)

    def time(self, part: str, call: Callable[[], object]) -> Any:
        """Run ``call`` and note its duration; return what it returns."""
        start = perf_counter_ns()
        result = call()
        self.note(part, start)
        return result

    def note(self, part: str, start: int) -> None:
        """Note the duration of a part that began at ``start`` (ns of the clock)."""
        self._durations[part].append((perf_counter_ns() - start) / 1e3)

    def medians(self) -> dict[str, float]:
        """Median duration of each part."""
        return {part: float(np.median(values)) for part, values in self._durations.items()}

    def tail(self, *parts: str) -> tuple[float, float]:
        """99th percentile and largest of the sum of some parts."""
        total = np.sum([self._durations[part] for part in parts], axis=0)
        return float(np.percentile(total, 99)), float(total.max())


def bench_tick(name: ControllerName, solver: SolverName, count: int) -> None:
    """Print the control tick and its parts, timed in turn at the same states."""
    robot = load_robot()
    kinematics = FeetFixedKinematics(robot)
    estimator = FeetFixedEstimator(kinematics)
    samples = samples_of(name, count)
    _, s, s_dot = samples[0]
    reference = Reference(ResidualFilter(bandwidth=15.0))
    readings = Readings.of(robot.n_joints)
    readings.joint_position, readings.joint_velocity = s, s_dot
    state = estimator.estimate(readings)
    stance = make_stance(kinematics, robot.crouch)
    plan = ScaledCurvePlan(plan_com_trajectory(0.04), robot, stance)
    reference.start(plan, state.com)
    dynamics = FeetFixedDynamics(kinematics)
    config = dataclasses.replace(CONTROLLERS[name], solver=solver)
    controller: VelocityController | TorqueController
    if isinstance(config, TorqueConfig):
        controller = TorqueController(config, kinematics)
    else:
        controller = VelocityController(config, kinematics)
    controller.reset(stance)
    qp = controller.qp
    problem = qp.problem
    alone = CheckedSolver(solver, problem)

    watch = Stopwatch()
    for now, s, s_dot in samples:
        readings.joint_position, readings.joint_velocity = s, s_dot
        watch.time("estimate", partial(estimator.estimate, readings))
        watch.time("set point", partial(reference.update, now))
        setpoint = reference.setpoint
        watch.time("tick", partial(controller.command, state, setpoint))
        if isinstance(controller, TorqueController):
            watch.time("dynamics", partial(dynamics.update, s, s_dot))
        watch.time("QP: pose, solve, check", partial(qp.solve, state, setpoint))
        solution, _ = watch.time("QP: solve, check", alone.solve)
        watch.time("QP: check", partial(check_solution, problem, solution))

    medians = watch.medians()
    tick = medians.pop("tick")
    print(
        f"{name} tick with {solver}, from estimated state to joint command: {tick:.1f} us, "
        f"median of {count}"
    )
    before = [f"{part} {medians.pop(part):.1f} us" for part in ("estimate", "set point")]
    for part, duration in medians.items():
        print(f"  {part:24s} {duration:7.1f} us")
    p99, worst = watch.tail("estimate", "set point", "tick")
    period = 1e6 / config.frequency
    print(
        f"  from readings to command: 99 % within {p99:.0f} us, worst {worst:.0f} us, "
        f"of a period of {period:.0f} us"
    )
    print(f"  before it: {', '.join(before)}")


def bench_phases(name: ControllerName, episodes: int) -> None:
    """Print the ticks of all phases with feedback in flight and landing, estimate included."""
    env = make_env(JumpConfig.of(controller=name, stand_time=1.0, **VERSIONS["ICubJump-v1"]))
    run_episode(env, seed=0)  # compiles
    watch = Stopwatch()
    controller, estimator = env._controller, env._estimator
    tick, estimate = controller.tick, estimator.estimate

    def timed_estimate(readings: Readings) -> RobotState:
        phase = controller.phases.phase.name.lower()
        return watch.time(f"estimate {phase}", partial(estimate, readings))

    def timed_tick(state: RobotState, time: float, target: np.ndarray) -> Tick:
        start = perf_counter_ns()
        result = tick(state, time, target)
        # Known only now: a tick may begin a phase.
        watch.note(controller.phases.phase.name.lower(), start)
        return result

    controller.tick, estimator.estimate = timed_tick, timed_estimate
    for seed in range(episodes):
        run_episode(env, seed)
    env.close()
    medians = watch.medians()
    print(f"{name} controller, ICubJump-v1: control tick, and estimate before it")
    for phase in ("launch", "flight", "landing"):
        p99, worst = watch.tail(phase)
        print(
            f"  {phase:8s} {medians[phase]:6.1f} us (99 % within {p99:.0f}, worst {worst:.0f}), "
            f"estimate {medians['estimate ' + phase]:.1f} us"
        )


def bench_episode(name: ControllerName, repetitions: int) -> None:
    """Print how much faster than real time the nominal episode runs."""
    env = make_env(JumpConfig(controller=name))
    factors = []
    for seed in range(repetitions):
        start = perf_counter_ns()
        episode = run_episode(env, seed)
        wall = (perf_counter_ns() - start) / 1e9
        flown = episode.jump["takeoff_time"] + episode.jump["flight_time"]
        factors.append((flown + env.config.success.stand_time) / wall)
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
        bench_phases(controller, max(1, arguments.episodes // 3))
    for controller in ("velocity", "torque"):
        bench_episode(controller, arguments.episodes)


if __name__ == "__main__":
    main()
