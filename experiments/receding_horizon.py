"""Does it help to plan the CoM anew while the robot launches?

    python -m experiments.receding_horizon --controller velocity

follows whole-body plans as they are, and with a CoM that is planned anew every 20 ms of the
launch: a small QP leads it from where it is believed to be to the plan's take-off, while posture
and momentum stay the plan's. The velocity controller's CoM lags behind its set point, so what
begins at the estimated velocity begins too slowly; it is also tried from the position alone.
"""

from __future__ import annotations

import copy
import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TUNING
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import ControllerName
from icub_jump_env.control.jump import JumpController
from icub_jump_env.control.launch import Launch, TrackingController
from icub_jump_env.control.phases import Phase
from icub_jump_env.control.qp.problem import IDLE, QuadraticProgram
from icub_jump_env.control.qp.solvers import CheckedSolver
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode
from icub_jump_env.evaluation.quantities import CM, number, seeds, spread
from icub_jump_env.evaluation.report.output import new_table, progress_display, show
from icub_jump_env.evaluation.statistics.difference import Difference
from icub_jump_env.evaluation.statistics.intervals import Interval
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.robot.icub import GRAVITY, Sole
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.statics import Stance
from icub_jump_env.simulation.randomization import RandomizationName

Array = NDArray[np.float64]

Source = Literal["position", "state"]
"""What re-planning takes from the estimate: the CoM's position, or its velocity as well."""

COMMANDS: dict[ControllerName, tuple[float, ...]] = {
    "velocity": (0.05, 0.07),
    "torque": (0.05, 0.065),
}
"""Commanded heights (m)."""

WORLDS: tuple[RandomizationName, ...] = ("full", "hard")

PERIOD = 0.02
"""Time between two plans (s); the last one begins as long before take-off, or earlier."""

NODES = 10
"""Intervals of the horizon, which ends at take-off."""

FRICTION, LEAST_LOAD, MOST_LOAD, COP_MARGIN = 0.5, 0.2, 4.0, 0.005
"""Of the floor, as the controller counts on; vertical force (weights); distance of the CoP to
heels and toes (m). The plan itself keeps further away from each."""

SPEED_WEIGHT, POSITION_WEIGHT = 1e4, 1e3
"""Of the squared errors at take-off (1/s, 1/s^3), against the integral of the squared
acceleration that is added to the plan's. Ten times more or less on the position changed little
(``hard``, seeds 100 to 119)."""

_XZ = [0, 2]


@dataclass(frozen=True)
class RecedingHorizonOptions:
    """Compare the plan with re-planning.

    Attributes:
        controller: Controller of the launching phase.
        episodes: Of each row.
    """

    controller: ControllerName = "velocity"
    episodes: int = 100

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1, len(TUNING))


class PlannedMotion(NamedTuple):
    """What the constraints know of the plan, at some times; columns are x and z in the world.

    Attributes:
        time: (k,) s.
        com: (k, 2) CoM over the floor (m).
        acceleration: (k, 2) m/s^2.
        momentum_rate: (k,) that of the angular momentum about +y (Nm).
    """

    time: Array
    com: Array
    acceleration: Array
    momentum_rate: Array

    @classmethod
    def of(cls, plan: JumpPlan, start: Array, intervals: int = 100) -> PlannedMotion:
        """The motion of a plan that begins with the CoM at ``start`` ((3,) m)."""
        time = np.linspace(0.0, plan.duration, intervals + 1)
        shape = len(time), 2
        motion = cls(time, np.zeros(shape), np.zeros(shape), np.zeros(len(time)))
        for k, instant in enumerate(time):
            setpoint = plan.sample(instant)
            motion.com[k] = (start + setpoint.com_position)[_XZ]
            motion.acceleration[k] = setpoint.com_acceleration[_XZ]
            motion.momentum_rate[k] = setpoint.angular_momentum_rate[1]
        return motion

    def at(self, time: Array) -> PlannedMotion:
        """The motion at other times (s)."""

        def values(known: Array) -> Array:
            return np.array([np.interp(time, self.time, column) for column in known.T]).T

        return PlannedMotion(
            time,
            values(self.com),
            values(self.acceleration),
            np.interp(time, self.time, self.momentum_rate),
        )


class Deviation(NamedTuple):
    """How the CoM's x and z deviate from the plan; accelerations are linear between nodes.

    Attributes:
        start: Time of the first node (s).
        step: Time between two nodes (s).
        position, velocity, acceleration: (NODES + 1, 2) m, m/s, m/s^2.
    """

    start: float
    step: float
    position: Array
    velocity: Array
    acceleration: Array

    def at(self, time: float) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration (2,) at ``time`` (s)."""
        k = min(max(int((time - self.start) / self.step), 0), NODES - 1)
        s = time - self.start - k * self.step
        v, a = self.velocity[k], self.acceleration[k]
        jerk = (self.acceleration[k + 1] - a) / self.step
        position = self.position[k] + s * v + s**2 / 2 * a + s**3 / 6 * jerk
        return position, v + s * a + s**2 / 2 * jerk, a + s * jerk


# Velocity and position at the nodes of a body at rest, by its accelerations there; steps of 1 s.
_FIRST, _SECOND = np.eye(NODES + 1)[:-1], np.eye(NODES + 1)[1:]
_REST = np.zeros(NODES + 1)
_VELOCITY = np.vstack([_REST, np.cumsum((_FIRST + _SECOND) / 2, axis=0)])
_POSITION = np.vstack([_REST, np.cumsum(_VELOCITY[:-1] + _FIRST / 3 + _SECOND / 6, axis=0)])


class ComReplanner:
    """The QP; its unknowns are the accelerations that are added to the plan's at the nodes.

    Where the CoM is on the plan they are zero: the plan stays as it is.
    """

    def __init__(self, sole: Sole, mass: float) -> None:
        """Set up the QP for soles whose frames are at the world's origin, and a mass (kg)."""
        self._cop_range = sole.x_min + COP_MARGIN, sole.x_max - COP_MARGIN
        self._mass = mass
        self._problem = QuadraticProgram(2 * (NODES + 1), NODES + 1, 0)
        self._solver = CheckedSolver("daqp", self._problem)

    def solve(
        self, motion: PlannedMotion, time: float, offset: Array, velocity: Array
    ) -> Deviation | None:
        """Plan from a deviation at ``time`` (s) until take-off.

        Args:
            motion: The plan.
            time: Now.
            offset: (2,) of the CoM from the plan (m).
            velocity: (2,) likewise (m/s).

        Returns:
            The deviation from now on; None if the QP has no solution.
        """
        nodes = np.linspace(time, motion.time[-1], NODES + 1)
        step = nodes[1] - nodes[0]
        to_velocity, to_position = step * _VELOCITY, step**2 * _POSITION
        drift = offset + np.outer(nodes - time, velocity)
        problem, size = self._problem, NODES + 1
        problem.H[:] = step * np.eye(2 * size)
        for axis, own in enumerate((slice(size), slice(size, None))):
            speed, place = to_velocity[-1], to_position[-1]
            problem.H[own, own] += SPEED_WEIGHT * np.outer(speed, speed)
            problem.H[own, own] += POSITION_WEIGHT * np.outer(place, place)
            problem.g[own] = SPEED_WEIGHT * velocity[axis] * speed
            problem.g[own] += POSITION_WEIGHT * drift[-1, axis] * place
        self._write_contact(motion.at(nodes), drift, to_position)
        solution, report = self._solver.solve()
        if report.failed:
            return None
        added = solution.x.reshape(2, size).T
        return Deviation(
            time, step, drift + to_position @ added, velocity + to_velocity @ added, added
        )

    def _write_contact(self, planned: PlannedMotion, drift: Array, to_position: Array) -> None:
        """Friction under the planned load, the load itself, and the CoP to first order."""
        (x, z), (forward, upward) = planned.com.T, planned.acceleration.T
        load = upward + GRAVITY
        problem, size = self._problem, NODES + 1
        cop = x - (z * forward + planned.momentum_rate / self._mass) / load
        problem.C[:, :size] = to_position - np.diag(z / load)
        problem.C[:, size:] = np.diag((x - cop) / load) - (forward / load)[:, None] * to_position
        drifted = cop + drift[:, 0] - forward / load * drift[:, 1]
        heel, toe = self._cop_range
        problem.lower[:] = np.r_[
            -FRICTION * load - forward, LEAST_LOAD * GRAVITY - load, heel - drifted
        ]
        problem.upper[:] = np.r_[
            FRICTION * load - forward, MOST_LOAD * GRAVITY - load, toe - drifted
        ]


class Replanning:
    """A tracking controller whose CoM set point is planned anew every :data:`PERIOD`.

    Where the QP has no solution, the latest plan goes on.

    Attributes:
        report: How the latest tick's QP went, that of the tracking.
        solves: QPs so far.
        failures: Those without a solution.
    """

    def __init__(
        self,
        tracking: TrackingController,
        jump: JumpController,
        config: JumpConfig,
        source: Source,
    ) -> None:
        """Wrap the controller of a jump's launching phase."""
        self._tracking, self._jump, self._source = tracking, jump, source
        self._dt = config.control_dt
        self._ticks_per_plan = round(PERIOD / self._dt)
        robot = config.robot_value
        self._replanner = ComReplanner(robot.sole, FeetFixedKinematics(robot).mass)
        self._tick = 0
        self._motion: PlannedMotion
        self._deviation: Deviation
        self.report = IDLE
        self.solves = self.failures = 0

    def reset(self, stance: Stance) -> None:
        """The jump begins, on the plan."""
        self._tracking.reset(stance)
        self._tick = 0
        still = np.zeros((NODES + 1, 2))
        self._deviation = Deviation(0.0, self._jump.plan.duration / NODES, still, still, still)
        self._motion = PlannedMotion.of(
            self._jump.plan, self._jump.reference.setpoint.com_position
        )

    def command(self, state: RobotState, setpoint: Setpoint) -> JointCommand:
        """One control tick."""
        time = self._tick * self._dt
        if self._tick % self._ticks_per_plan == 0 and time <= self._motion.time[-1] - PERIOD:
            self._replan(state, setpoint, time)
        self._tick += 1
        moved = copy.deepcopy(setpoint)
        position, velocity, acceleration = self._deviation.at(time)
        moved.com_position[_XZ] += position
        moved.com_velocity[_XZ] += velocity
        moved.com_acceleration[_XZ] += acceleration
        command = self._tracking.command(state, moved)
        self.report = self._tracking.report
        return command

    def _replan(self, state: RobotState, setpoint: Setpoint, time: float) -> None:
        offset = (state.com - setpoint.com_position)[_XZ]
        velocity = (state.com_velocity - setpoint.com_velocity)[_XZ]
        if self._source == "position":
            velocity = self._deviation.at(time)[1]
        found = self._replanner.solve(self._motion, time, offset, velocity)
        self.solves += 1
        self.failures += found is None
        self._deviation = found or self._deviation


def compare_plans(options: RecedingHorizonOptions) -> None:
    """Jump with the plan and with re-planning, and print the table."""
    console, progress = Console(), Console(stderr=True)
    used = TUNING[: options.episodes]
    table = new_table(
        3, "world", "command, cm", "CoM", "landed, %", "gain", "rise, cm", "gain", "failed, %"
    )
    for world in WORLDS:
        for command in COMMANDS[options.controller]:
            config = JumpConfig.of(
                planner="whole_body",
                controller=options.controller,
                jump_height=command,
                randomization=world,
            )
            planned, _ = jump(config, used, None, progress)
            _add(table, world, command, "as planned", planned)
            for source in get_args(Source):
                episodes, failed = jump(config, used, source, progress)
                _add(table, world, command, f"from {source}", episodes, planned, failed)
            table.rows[-1].end_section = True
    table.caption = (
        f"{options.controller} controller, {seeds(used)} for each row; from position: re-planned "
        f"every {PERIOD:g} s from where the CoM is estimated, its velocity that of the set point; "
        "from state: its velocity estimated, too; gain: over the plan in the same episodes, with "
        "an interval of 95 % each; failed: re-plannings without a solution"
    )
    show(console, table)


def jump(
    config: JumpConfig, used: Sequence[int], source: Source | None, progress: Console
) -> tuple[list[Episode], float]:
    """Episodes with the plan as it is, or with re-planning.

    Args:
        config: The jump.
        used: Seeds of the episodes.
        source: What is re-planned from; None for the plan.
        progress: Where the progress is shown.

    Returns:
        The episodes, and the share of QPs without a solution; successes are landings.
    """
    env = make_env(config)
    replanning = None if source is None else replan(env, source)
    with progress_display(progress) as display:
        tracked = display.track(used, description=f"jumping, {source or 'plan'}")
        episodes = [run_episode(env, seed) for seed in tracked]
    env.close()
    failed = 0.0 if replanning is None else replanning.failures / replanning.solves
    landings = [dataclasses.replace(e, is_success=e.landed) for e in episodes]
    return landings, failed


def replan(env: ICubJumpEnv, source: Source) -> Replanning:
    """Re-plan in all further episodes of an environment.

    The package has no place for it, so this replaces what its launching phase tracks with.
    """
    jumping = env._controller
    launch = jumping._controllers[Phase.LAUNCH]
    assert isinstance(launch, Launch)
    replanning = Replanning(launch._controller, jumping, env.config, source)
    launch._controller = replanning
    return replanning


def _add(
    table: Table,
    world: str,
    command: float,
    name: str,
    episodes: Sequence[Episode],
    planned: Sequence[Episode] | None = None,
    failed: float | None = None,
) -> None:
    """A row, with the gain over the plan's episodes if there are any."""
    summary = Summary.of(episodes)
    landed, rise = "-", "-"
    if planned is not None:
        gain = Difference.of(episodes, planned)
        landed = _gain(gain.success, gain.success_interval, "%")
        rise = _gain(gain.rise, gain.rise_interval, "cm")
    table.add_row(
        world,
        f"{CM * command:g}",
        name,
        number(summary.landed.share, "%"),
        landed,
        number(summary.mean_rise, "cm"),
        rise,
        number(failed, "%"),
    )


def _gain(value: float, interval: Interval, unit: str) -> str:
    return f"{number(value, unit, signed=True)} ({spread(*interval, unit, signed=True)})"


if __name__ == "__main__":
    guarded(lambda: compare_plans(parse(RecedingHorizonOptions, sys.argv[1:])))
