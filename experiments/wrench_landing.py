"""A whole-body QP with contact wrenches that lands the robot, against landing by feedback.

    python -m experiments.wrench_landing --episodes 20
    python -m experiments.wrench_landing --realistic
    python -m experiments.wrench_landing --parts

The QP of eq. 6 decides the torques of all joints once the impact is over. Its demands come from the
same capture point, lunge and heights as those of
:class:`icub_jump_env.control.landing.FeedbackLanding`. With ``--parts`` the QP loses its
parts, one at a time. Gains were chosen on the first 40 of the tuning seeds; jumped are later ones.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.seeds import TUNING
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.catching import (
    FARTHEST_LATERAL_COP,
    LATERAL_CAPTURE_GAIN,
    LOWEST_COM,
    MOMENTUM_SHARE,
    Balance,
)
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import ContactConfig, ControllerName, SolverName, Weights
from icub_jump_env.control.flight import Flight
from icub_jump_env.control.landing import FeedbackLanding, Landing
from icub_jump_env.control.phases import Phase, Tick
from icub_jump_env.control.tasks.com import ComAcceleration
from icub_jump_env.control.tasks.contact import ContactLimits, SmallWrenches
from icub_jump_env.control.tasks.feet import FeetAcceleration
from icub_jump_env.control.tasks.limits import AccelerationLimits, TorqueLimits
from icub_jump_env.control.tasks.momentum import MomentumRate
from icub_jump_env.control.tasks.motion import BaseMotion
from icub_jump_env.control.tasks.posture import PostureAcceleration
from icub_jump_env.control.tasks.smoothness import TorqueSmoothness
from icub_jump_env.control.tasks.stack import TaskQP
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.modes.landing_cases import (
    FEEDBACK,
    VARIANTS,
    LandingCase,
    landing_cases,
)
from icub_jump_env.evaluation.quantities import CONTROLLERS, number, seeds
from icub_jump_env.evaluation.report.output import new_table, progress_display, show
from icub_jump_env.evaluation.statistics.summary import Rate
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.robot.dynamics import GRAVITY, FeetFixedDynamics
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.simulation.actuators.config import ActuatorName

Array = NDArray[np.float64]

CASES = (
    "4 cm, full",
    "4 cm, hard",
    "8 cm after 8 cm, full",
    "plan, full",
    "floor tilt fore-aft +5",
    "step under the left foot 2",
    "rotation at lift-off -10",
    "push after landing +0.3",
    "push after landing -0.3",
    "push after landing -0.35",
)
"""Ends of the names of the landing study's cases that are jumped."""

FEW = (CASES[0], CASES[1], CASES[4], CASES[7])
"""Those that are jumped with realistic actuators."""

HARDEST = "push after landing -0.3"
"""The case in which parts of the controller are taken away."""

FIRST = 40
"""The first of the tuning seeds on which no gain was chosen."""


@dataclass(frozen=True)
class WrenchOptions:
    """Compare the landings.

    Attributes:
        episodes: Of each row.
        realistic: With realistic actuators, whose torque loops have a bandwidth and friction.
        parts: Take the parts of the QP away instead, one at a time.
    """

    episodes: int = 20
    realistic: bool = False
    parts: bool = False

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1, len(TUNING) - FIRST)


@dataclass(frozen=True)
class WrenchGains:
    """What the QP is made of.

    Attributes:
        impact: How long after touch-down the velocity QP goes on to yield (s).
        height: Stiffness and damping of the CoM's height (1/s^2, 1/s).
        com_weight: Weight of the CoM's acceleration ((m/s^2)^-2).
        momentum: How fast wrong angular momentum is taken off (1/s).
        momentum_weight: Weight of its rate (Nm^-2).
        hardest_lunge: Largest rate of the lunge's momentum (Nm).
        posture: Stiffness and damping of the posture (1/s^2, 1/s).
        posture_weight: Of legs, torso and arms ((rad/s^2)^-2).
        feet_damping: How fast a motion of the soles relative to each other is taken off (1/s).
        feet_weight: Weight of that ((m/s^2)^-2, (rad/s^2)^-2); infinite makes it a constraint.
        wrench_weight: Weight of the wrenches (N^-2, Nm^-2): the feet share the load.
        smoothness_weight: Weight of changes of the torques (Nm^-2).
        friction: Coulomb friction counted on.
        least_force: Of each foot (N).
        cop_margin: Distance of the CoP from the edges of the soles (m).
        horizons: When speed and position limits must hold (s).
        joint_damping: Torque per speed that the QP did not ask for (Nm s/rad).
        leak: How fast that speed, the integral of the accelerations, follows the joints (1/s).
    """

    impact: float = 0.1
    height: tuple[float, float] = (60.0, 14.0)
    com_weight: float = 1e3
    momentum: float = 8.0
    momentum_weight: float = 10.0
    hardest_lunge: float = 30.0
    posture: tuple[float, float] = (5.0, 4.5)
    posture_weight: Weights = (1.0, 1.0, 0.3)
    feet_damping: float = 30.0
    feet_weight: float = 1e3
    wrench_weight: float = 1e-3
    smoothness_weight: float = 1e-3
    friction: float = 0.4
    least_force: float = 5.0
    cop_margin: float = 0.003
    horizons: tuple[float, float] = (0.02, 0.06)
    joint_damping: float = 2.0
    leak: float = 20.0


PARTS: dict[str, WrenchGains] = {
    "all parts": WrenchGains(),
    "QP from touch-down on": WrenchGains(impact=0.0),
    "feet as in the launch": WrenchGains(feet_damping=0.0, feet_weight=math.inf),
    "feet not damped": WrenchGains(feet_damping=0.0),
    "damped as a constraint": WrenchGains(feet_weight=math.inf),
    "CoP margin 1 cm": WrenchGains(cop_margin=0.01),
    "no joint damping": WrenchGains(joint_damping=0.0),
    "loads not shared": WrenchGains(wrench_weight=1e-4),
}
"""The controller, and what it is without one of its parts."""


class SolesDamped(FeetAcceleration):
    """The soles lose their motion relative to each other, but for a vertical speed.

    Attributes:
        speed: Speed at which the right sole shall rise relative to the left one (m/s).
    """

    speed = 0.0

    def __init__(
        self,
        kinematics: FeetFixedKinematics,
        dynamics: FeetFixedDynamics,
        damping: float,
        weight: float,
    ) -> None:
        super().__init__(kinematics, dynamics)
        self._damping, self.weight, self.scale = damping, weight, 1.0

    def write(self, state: RobotState, setpoint: Setpoint, rows: Array, target: Array) -> None:
        """Write the equation; its rows have the left foot minus the right one, base axes."""
        super().write(state, setpoint, rows, target)
        motion = self._kinematics.J_feet @ state.joint_velocity
        motion[:3] += self.speed * self._kinematics.base_rotation[2]
        target -= self._damping * motion
        rows *= self.scale
        target *= self.scale


class WrenchLanding(FeedbackLanding):
    """Torques of all joints by one QP in joint accelerations and contact wrenches.

    Where the QP has no solution, the torques before it fade.

    Attributes:
        solution: (n + 12,) joint accelerations (rad/s^2) and the wrenches of the left and the
            right foot, force (N) and moment (Nm) in the sole frames.
        torque: (n,) the torques that belong to it (Nm).
        dynamics: The equations of motion that the latest QP had.
    """

    def __init__(
        self,
        flight: Flight,
        residual: ResidualFilter,
        dt: float,
        kinematics: FeetFixedKinematics,
        solver: SolverName,
        gains: WrenchGains,
    ) -> None:
        """Set up the phase, as :class:`FeedbackLanding`, with the gains of the QP."""
        super().__init__(flight, residual, dt, kinematics, solver)
        self._gains, robot = gains, kinematics.robot
        n, sole, margin = robot.n_joints, robot.sole, gains.cop_margin
        self.dynamics = dynamics = FeetFixedDynamics(kinematics)
        self.torque, self.solution = np.zeros(n), np.zeros(n + 12)
        self._rate, self._rise, self._lifting = np.zeros(n), 0.0, 0.0
        inner = dataclasses.replace(
            sole,
            x_min=sole.x_min + margin,
            x_max=sole.x_max - margin,
            half_width=sole.half_width - margin,
        )
        constrained = math.isinf(gains.feet_weight)
        self._soles = SolesDamped(
            kinematics, dynamics, gains.feet_damping, 1.0 if constrained else gains.feet_weight
        )
        feet = [self._soles]
        smooth = np.full(n, gains.smoothness_weight)
        self._wrench_qp = TaskQP(
            n + 12,
            costs=[
                PostureAcceleration(
                    *gains.posture, robot.per_joint("posture", gains.posture_weight)
                ),
                SmallWrenches(gains.wrench_weight, n),
            ],
            soft=[
                TorqueSmoothness(dynamics, smooth, self.torque),
                ComAcceleration(dynamics, 0.0, 0.0, gains.com_weight),
                MomentumRate(dynamics, gains.momentum, gains.momentum_weight),
                *([] if constrained else feet),
            ],
            hard=[BaseMotion(dynamics), *(feet if constrained else [])],
            limits=[
                AccelerationLimits(robot, *gains.horizons),
                TorqueLimits(dynamics, robot),
                ContactLimits(
                    ContactConfig(friction=gains.friction, minimum_force=gains.least_force),
                    dataclasses.replace(robot, sole=inner),
                ),
            ],
            solver=solver,
        )

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        super().start(state, plan, time)
        self.torque[:] = 0.0
        self._rate[:] = state.joint_velocity
        self._rise = -self._sinking
        self.setpoint.angular_momentum[:] = 0.0

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        if time - self._began < self._gains.impact:
            tick = super().tick(state, time, residual_target)
            self._rate[:] = self._velocity
            return tick
        gains, setpoint, dt = self._gains, self.setpoint, self._dt
        s_dot, limit = state.joint_velocity, self._robot.effort_limit
        self._residual.step(residual_target, dt)
        # From here on the vertical is that of gravity, and the IMU says how the base stands.
        upright = pin.exp3(np.cross(state.gravity, [0.0, 0.0, -1.0]))
        np.dot(upright, state.base_rotation, out=self._kinematics.base_rotation)
        self.dynamics.update(state.joint_position, s_dot)
        self._demand(state, time)
        solution, report = self._wrench_qp.solve(state, setpoint)
        if report.failed:
            self.torque *= 0.9
            acceleration = np.zeros_like(s_dot)
        else:
            self.solution[:] = solution.x
            np.dot(self.dynamics.torque_rows, solution.x, out=self.torque)
            self.torque += self.dynamics.torque_bias
            acceleration = solution.x[:-12]
        self._rate += dt * (acceleration + gains.leak * (s_dot - self._rate))
        torque = self.torque + gains.joint_damping * (self._rate - s_dot)
        return Tick(JointCommand(torque=np.clip(torque, -limit, limit)), report)

    def _stand_at(self, time: float) -> tuple[float, float, float]:
        """As :class:`FeedbackLanding`; also the rise's derivative (m/s^2)."""
        forward, height, rise = super()._stand_at(time)
        self._lifting, self._rise = (rise - self._rise) / self._dt, rise
        return forward, height, rise

    def _demand(self, state: RobotState, time: float) -> None:
        """Set the accelerations of CoM and lunge in the set point, and what the soles do."""
        gains, setpoint = self._gains, self.setpoint
        offset, velocity = self._residual.offset, self._residual.velocity
        forward, height, rise = self._stand_at(time)
        height, rise = height + offset[2], rise + velocity[2]
        # The ankles are where balance has them.
        setpoint.posture[self._ankles] = state.joint_position[self._ankles]
        setpoint.com_position[:] = forward + offset[0], offset[1], height
        away = state.joint_position - setpoint.posture
        balance = self._catch.update(state, setpoint.com_position, away)
        self._soles.speed = balance.lift
        momentum, most = setpoint.angular_momentum, gains.hardest_lunge
        lunge = min(max((balance.pitch_momentum - momentum[1]) / self._dt, -most), most)
        momentum[1] += lunge * self._dt
        setpoint.angular_momentum_rate[1] = lunge

        stiffness, damping = gains.height
        setpoint.com_acceleration[:] = self._horizontal(state, balance, lunge)
        setpoint.com_acceleration[2] = (
            self._lifting
            + stiffness * (height - self._kinematics.com[2])
            + damping * (rise - state.com_velocity[2])
        )
        setpoint.com_acceleration += GRAVITY - np.linalg.norm(GRAVITY) * state.gravity

    def _horizontal(self, state: RobotState, balance: Balance, lunge: float) -> Array:
        """The CoM's acceleration (3,) of the pendulum, with the lunge's moment (Nm) (m/s^2)."""
        cos, sin = heading(state.base_rotation)
        to_heading = np.array([[cos, sin], [-sin, cos]])
        com, down = state.com - state.sole_position.mean(axis=0), state.gravity
        height = max(LOWEST_COM, float(com[2]))
        frequency = math.sqrt(np.linalg.norm(GRAVITY) / height)
        lever = 1.0 / (self._kinematics.mass * height)
        ahead, left = to_heading @ (com[:2] - com[2] / down[2] * down[:2])
        goal = float((to_heading @ self.setpoint.com_position[:2])[1])
        # Sideways as forward in Catch, which tells only how the feet shall share the load.
        falling = -MOMENTUM_SHARE * lever * float(to_heading[0] @ state.angular_momentum[:2])
        speed = float(to_heading[1] @ state.com_velocity[:2]) + falling
        point = left - goal + speed / frequency
        wanted = point * (1.0 + LATERAL_CAPTURE_GAIN / frequency)
        cop = np.array(
            [
                balance.cop - self._robot.sole.center_x,
                goal + min(max(wanted, -FARTHEST_LATERAL_COP), FARTHEST_LATERAL_COP),
            ]
        )
        acceleration = frequency**2 * (np.array([ahead, left]) - cop)
        acceleration[0] -= lever * lunge
        return np.array([*(to_heading.T @ acceleration), 0.0])


class Watched:
    """A landing whose ticks are timed and whose QPs without a solution are counted.

    Attributes:
        seconds: How long each tick took (s).
        failures: How many QPs had no solution.
    """

    def __init__(self, landing: Landing) -> None:
        self._landing = landing
        self.start = landing.start
        self.seconds: list[float] = []
        self.failures = 0

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick."""
        began = clock.perf_counter()
        tick = self._landing.tick(state, time, residual_target)
        self.seconds.append(clock.perf_counter() - began)
        self.failures += tick.report is not None and tick.report.failed
        return tick


def landing_by_wrenches(env: ICubJumpEnv, gains: WrenchGains) -> WrenchLanding:
    """A landing that can take the place of the environment's, which is by feedback."""
    old = env._controller._landing
    if not isinstance(old, FeedbackLanding):
        raise TypeError("the environment lands without feedback")
    solver = env.config.controller_config.solver
    return WrenchLanding(old._flight, old._residual, old._dt, old._kinematics, solver, gains)


def watch(env: ICubJumpEnv, gains: WrenchGains | None) -> Watched:
    """Watch the landings of an environment; with ``gains`` they are those of the QP."""
    jumping = env._controller
    watched = Watched(jumping._landing if gains is None else landing_by_wrenches(env, gains))
    jumping._controllers[Phase.LANDING] = watched
    return watched


class Landings(NamedTuple):
    """What some landings were like.

    Attributes:
        landed: How many landed.
        force: Median of the largest force under the feet (N).
        failures: QPs without a solution.
        seconds: Median time of a tick (s).
    """

    landed: Rate
    force: float
    failures: int
    seconds: float

    def cells(self) -> list[str]:
        """For tables."""
        landed = f"{self.landed.count}/{self.landed.total}"
        force, time = number(self.force, "N"), f"{1e6 * self.seconds:.0f}"
        return [landed, self.landed.bounds, force, str(self.failures), time]


def land(config: JumpConfig, used: Sequence[int], gains: WrenchGains | None) -> Landings:
    """Jump with the seeds ``used`` and land by feedback, or with ``gains`` by the QP."""
    env = make_env(config)
    watched = watch(env, gains)
    jumps = [run_episode(env, seed).jump for seed in used]
    env.close()
    landed = Rate(sum(bool(jump["landed"]) for jump in jumps), len(jumps))
    force = float(np.nanmedian([jump["landing_force"] for jump in jumps]))
    return Landings(landed, force, watched.failures, float(np.median(watched.seconds)))


def cases(controller: ControllerName, actuators: ActuatorName = "ideal") -> dict[str, JumpConfig]:
    """The jumps of one controller by name."""

    def name(case: LandingCase) -> str:
        return f"{case.group} {case.label}".strip()

    known = landing_cases(JumpConfig.of(controller=controller))
    ends = CASES if actuators == "ideal" else FEW
    chosen = [next(case for case in known if name(case).endswith(end)) for end in ends]
    always = {"controller": controller, "actuators": actuators, **VARIANTS[FEEDBACK]}
    return {name(case): JumpConfig.of(**always, **case.changes) for case in chosen}


def run(options: WrenchOptions) -> None:
    """Compare the landings, or take away the parts of the QP."""
    console, used = Console(), TUNING[FIRST : FIRST + options.episodes]
    actuators: ActuatorName = "realistic" if options.realistic else "ideal"
    with progress_display(Console(stderr=True)) as progress:
        for controller in progress.track(CONTROLLERS):
            if options.parts:
                show(console, render_parts(controller, used))
            else:
                show(console, render_jumps(controller, actuators, used))


def render_jumps(controller: ControllerName, actuators: ActuatorName, used: range) -> Table:
    """Both landings in all cases."""
    title = f"{controller} controller, {actuators} actuators, {seeds(used)}"
    table = _table("jump", "landing", title=title)
    for label, config in cases(controller, actuators).items():
        table.add_row(label, "feedback", *land(config, used, None).cells())
        found = land(config, used, WrenchGains())
        table.add_row("", "wrench QP", *found.cells(), end_section=True)
    return table


def render_parts(controller: ControllerName, used: range) -> Table:
    """The QP without one of its parts, in a hard case."""
    config = cases(controller)[HARDEST]
    title = f"{controller} controller, {HARDEST} m/s, {seeds(used)}"
    table = _table("wrench QP", title=title)
    for label, gains in PARTS.items():
        table.add_row(label, *land(config, used, gains).cells())
    return table


def _table(*labels: str, title: str) -> Table:
    return new_table(
        len(labels), *labels, "landed", "95 %", "force, N", "failed", "us", title=title
    )


if __name__ == "__main__":
    guarded(lambda: run(parse(WrenchOptions, sys.argv[1:])))
