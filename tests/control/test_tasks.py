"""Every task against Pinocchio, at moving robots and set points none of whose parts is zero."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from standing import GRAVITY, ROBOT, N, Oracle, Standing

from icub_jump_env.control.config import ContactConfig
from icub_jump_env.control.tasks.centroidal import CentroidalVelocity
from icub_jump_env.control.tasks.com import ComAcceleration, ComVelocity
from icub_jump_env.control.tasks.contact import ContactLimits, SmallWrenches, contact_rows
from icub_jump_env.control.tasks.feet import FeetAcceleration, FeetVelocity, SolesApart
from icub_jump_env.control.tasks.limits import AccelerationLimits, TorqueLimits, VelocityLimits
from icub_jump_env.control.tasks.momentum import MomentumIntegral, MomentumRate
from icub_jump_env.control.tasks.motion import BaseMotion
from icub_jump_env.control.tasks.posture import PostureAcceleration, PostureVelocity
from icub_jump_env.control.tasks.smoothness import TorqueSmoothness, VelocitySmoothness
from icub_jump_env.control.tasks.stack import TaskQP
from icub_jump_env.robot.dynamics import FeetFixedDynamics

seeds = st.integers(0, 10_000)


@dataclasses.dataclass
class Case:
    """What the tasks and their oracles are made of."""

    seed: int

    def __post_init__(self):
        self.standing = Standing(self.seed)
        self.state, self.wanted = self.standing.state, self.standing.ask(posture=0.3)
        self.kinematics, self.rng = self.standing.kinematics, self.standing.rng
        self.oracle = Oracle(self.standing)
        self.dynamics = FeetFixedDynamics(self.kinematics)
        self.dynamics.update(self.state.joint_position, self.state.joint_velocity)
        self.previous = 5.0 * self.rng.normal(size=N)
        self.integral = 0.1 * self.rng.normal(size=3)
        self.weights = self.rng.uniform(0.5, 2.0, N)
        self.world = self.state.base_rotation
        self.errors = {
            "com": self.oracle.com - self.wanted.com_position,
            "com_velocity": self.oracle.momentum(self.state.joint_velocity)[:3] / self.oracle.mass
            - self.wanted.com_velocity,
            "momentum": self.oracle.momentum(self.state.joint_velocity)[3:]
            - self.wanted.angular_momentum,
            "posture": self.state.joint_position - self.wanted.posture,
            "posture_velocity": self.state.joint_velocity - self.wanted.posture_velocity,
        }


@dataclasses.dataclass
class Equation:
    """A task and its residual, written out in Pinocchio's terms.

    Attributes:
        make: The task.
        residual: Its residual at joint velocities, or at accelerations and wrenches.
        n: Number of unknowns.
        world: Whether the residual is in world axes and the task in those of the base.
    """

    make: Callable[[Case], Any]
    residual: Callable[..., np.ndarray]
    n: int = N + 12
    world: bool = False


EQUATIONS = {
    "(3b)": Equation(
        lambda c: ComVelocity(c.kinematics, 7.0, 30.0),
        lambda c, s_dot: (
            c.oracle.momentum(s_dot)[:3] / c.oracle.mass
            - (c.wanted.com_velocity - 7.0 * c.errors["com"])
        ),
        n=N,
    ),
    "(3d)": Equation(
        lambda c: MomentumIntegral(c.kinematics, 9.0, 20.0, c.integral),
        lambda c, s_dot: (
            c.oracle.momentum(s_dot)[3:] - (c.wanted.angular_momentum - 9.0 * c.integral)
        ),
        n=N,
    ),
    "(3c)": Equation(
        lambda c: FeetVelocity(c.kinematics),
        lambda c, s_dot: -c.oracle.in_base_frame(c.oracle.J[1] @ c.oracle.velocity(s_dot)),
        n=N,
    ),
    "(6b)": Equation(
        lambda c: ComAcceleration(c.dynamics, 150.0, 20.0, 40.0),
        lambda c, s_ddot, f: (
            c.oracle.contact(f)[:3] / c.oracle.mass
            + GRAVITY
            - c.wanted.com_acceleration
            + 150.0 * c.errors["com"]
            + 20.0 * c.errors["com_velocity"]
        ),
        world=True,
    ),
    "(6d)": Equation(
        lambda c: MomentumRate(c.dynamics, 9.0, 20.0),
        lambda c, s_ddot, f: (
            c.oracle.contact(f)[3:] - c.wanted.angular_momentum_rate + 9.0 * c.errors["momentum"]
        ),
        world=True,
    ),
    "(6c)": Equation(
        lambda c: FeetAcceleration(c.kinematics, c.dynamics),
        lambda c, s_ddot, f: (
            -c.oracle.in_base_frame(
                c.oracle.J[1] @ c.oracle.acceleration(s_ddot) + c.oracle.drift[1]
            )
        ),
    ),
    "base rows of (1)": Equation(
        lambda c: BaseMotion(c.dynamics),
        lambda c, s_ddot, f: c.oracle.forces(s_ddot, f)[:6],
    ),
    "second term of (6a)": Equation(
        lambda c: TorqueSmoothness(c.dynamics, c.weights, c.previous),
        lambda c, s_ddot, f: np.sqrt(c.weights) * (c.oracle.forces(s_ddot, f)[6:] - c.previous),
    ),
}


class Unit:
    """1/2 ||x||^2, which every QP needs."""

    def __init__(self, n):
        self.diagonal = np.ones(n)

    def subtract(self, state, setpoint, gradient):
        pass


def posed(n, case, costs=(), soft=(), hard=(), limits=()):
    qp = TaskQP(n, costs=[Unit(n), *costs], soft=soft, hard=hard, limits=limits, solver="daqp")
    qp.pose(case.state, case.wanted)
    return qp.problem


def residual_of(equation, case):
    """The oracle as a function of the unknowns."""
    if equation.n == N:
        return lambda x: equation.residual(case, x)
    return lambda x: equation.residual(case, x[:N], x[N:])


def unknowns(case, n):
    x = case.rng.normal(size=n)
    x[N:] *= 50.0  # forces
    return x


@pytest.mark.parametrize("name", EQUATIONS)
@settings(max_examples=5)
@given(seeds)
def test_a_hard_equation_is_the_papers(name, seed):
    case, equation = Case(seed), EQUATIONS[name]
    task = equation.make(case)
    problem = posed(equation.n, case, hard=[task])
    np.testing.assert_array_equal(problem.lower[equation.n :], problem.upper[equation.n :])
    for _ in range(2):
        x = unknowns(case, equation.n)
        ours = problem.C @ x - problem.lower[equation.n :]
        theirs = residual_of(equation, case)(x)
        assert task.size == len(theirs)
        if equation.world:
            ours = case.world @ ours
        np.testing.assert_allclose(ours, theirs, atol=1e-9 * max(1.0, np.abs(theirs).max()))


@pytest.mark.parametrize("name", EQUATIONS)
@settings(max_examples=3)
@given(seeds)
def test_a_soft_equation_is_its_weighted_square(name, seed):
    """The gradient of the cost against central differences of the oracle's square."""
    case, equation = Case(seed), EQUATIONS[name]
    task = equation.make(case)
    problem = posed(equation.n, case, soft=[task])
    residual, x = residual_of(equation, case), unknowns(case, equation.n)
    gradient = problem.H @ x + problem.g - x

    def cost(x):
        return task.weight / 2 * residual(x) @ residual(x)

    # Quadratic functions have exact central differences, so that a long step loses nothing.
    theirs = [(cost(x + step) - cost(x - step)) / 2 for step in np.eye(equation.n)]
    np.testing.assert_allclose(gradient, theirs, atol=1e-8 * max(1.0, np.abs(theirs).max()))


def test_the_wrenches_that_fulfil_6b_and_6d_give_the_com_and_the_momentum_these_rates():
    """Newton and Euler hold: with the base rows, forces are accelerations."""
    case = Case(1)
    names = ("(6b)", "(6d)", "(6c)", "base rows of (1)")
    tasks = [EQUATIONS[name].make(case) for name in names]
    problem = posed(N + 12, case, hard=tasks)
    x = np.linalg.lstsq(problem.C, problem.lower[N + 12 :])[0]
    np.testing.assert_allclose(problem.C @ x, problem.lower[N + 12 :], atol=1e-8)
    step, oracle, R = 1e-5, case.oracle, case.wanted
    # One step of the joints on either side, with the feet where they are.
    s, s_dot = case.state.joint_position.copy(), case.state.joint_velocity.copy()
    rates = []
    for h in (-step, step):
        moved = Standing(0)
        moved.be(s + h * s_dot + h**2 / 2 * x[:N])
        rates.append(Oracle(moved).momentum(s_dot + h * x[:N]))
    linear, angular = np.split((rates[1] - rates[0]) / (2 * step), 2)
    wanted = R.com_acceleration - 150.0 * case.errors["com"] - 20.0 * case.errors["com_velocity"]
    np.testing.assert_allclose(linear / oracle.mass, wanted, atol=1e-5)
    rate = R.angular_momentum_rate - 9.0 * case.errors["momentum"]
    np.testing.assert_allclose(angular, rate, atol=1e-4)


COSTS = {
    "first term of (3a)": (
        lambda c: PostureVelocity(2.0, c.weights),
        lambda c, x: c.weights * (x - c.wanted.posture_velocity + 2.0 * c.errors["posture"]),
        N,
    ),
    "second term of (3a)": (
        lambda c: VelocitySmoothness(c.weights, c.previous),
        lambda c, x: c.weights * (x - c.previous),
        N,
    ),
    "first term of (6a)": (
        lambda c: PostureAcceleration(12.0, 5.0, c.weights),
        lambda c, x: np.append(
            c.weights
            * (
                x[:N]
                - c.wanted.posture_acceleration
                + 12.0 * c.errors["posture"]
                + 5.0 * c.errors["posture_velocity"]
            ),
            np.zeros(12),
        ),
        N + 12,
    ),
    "wrenches": (
        lambda c: SmallWrenches(0.3, N),
        lambda c, x: np.append(np.zeros(N), 0.3 * x[N:]),
        N + 12,
    ),
}


@pytest.mark.parametrize("name", COSTS)
@given(seeds)
@settings(max_examples=5)
def test_a_cost_pulls_towards_its_goal(name, seed):
    case = Case(seed)
    make, gradient, n = COSTS[name]
    problem, x = posed(n, case, costs=[make(case)]), unknowns(case, n)
    np.testing.assert_allclose(problem.H @ x + problem.g - x, gradient(case, x), atol=1e-9)


def test_terms_add_up():
    """Costs, soft equations and the order of the rows, all in one QP."""
    case = Case(2)
    names = ("(6b)", "(6d)")
    together = posed(
        N + 12, case,
        costs=[COSTS[name][0](case) for name in ("first term of (6a)", "wrenches")],
        soft=[EQUATIONS[name].make(case) for name in names],
        limits=[TorqueLimits(case.dynamics, ROBOT), ContactLimits(ContactConfig(), ROBOT)],
        hard=[EQUATIONS[name].make(case) for name in ("(6c)", "base rows of (1)")],
    )  # fmt: skip
    single = [
        *(posed(N + 12, case, costs=[COSTS[n][0](case)]) for n in ("first term of (6a)", "wrenches")),
        *(posed(N + 12, case, soft=[EQUATIONS[name].make(case)]) for name in names),
    ]  # fmt: skip
    eye = np.eye(N + 12)
    scale = np.abs(together.H).max()
    np.testing.assert_allclose(
        together.H - eye, sum(p.H - eye for p in single), atol=1e-12 * scale
    )
    np.testing.assert_allclose(together.g, sum(p.g for p in single), rtol=1e-9, atol=1e-9)
    rows = [
        posed(N + 12, case, limits=[TorqueLimits(case.dynamics, ROBOT)]),
        posed(N + 12, case, limits=[ContactLimits(ContactConfig(), ROBOT)]),
        *(posed(N + 12, case, hard=[EQUATIONS[n].make(case)]) for n in ("(6c)", "base rows of (1)")),
    ]  # fmt: skip
    np.testing.assert_array_equal(together.C, np.vstack([p.C for p in rows]))
    for end in ("lower", "upper"):
        ours = getattr(together, end)[N + 12 :]
        np.testing.assert_array_equal(
            ours, np.concatenate([getattr(p, end)[N + 12 :] for p in rows])
        )
    assert together.n_equalities == 12


class TestLimits:
    def extreme(self, seed):
        """A case whose joints are close to one of their limits or beyond, at any speed."""
        case = Case(seed)
        rng = case.rng
        limit = np.where(rng.random(N) < 0.5, ROBOT.lower_position, ROBOT.upper_position)
        case.state.joint_position = limit + rng.uniform(-0.1, 0.1, N)
        case.state.joint_velocity = ROBOT.velocity_limit * rng.uniform(-1.1, 1.1, N)
        return case

    @given(seeds)
    @settings(max_examples=10)
    def test_velocities_end_where_the_speed_or_the_position_after_the_horizon_does(self, seed):
        case, horizon = self.extreme(seed), 0.02
        problem = posed(N, case, limits=[VelocityLimits(ROBOT, horizon, 0.9)])
        fastest = 0.9 * ROBOT.velocity_limit
        for bound, limit in (
            (problem.lower, ROBOT.lower_position),
            (problem.upper, ROBOT.upper_position),
        ):
            to_the_limit = (limit - case.state.joint_position) / horizon
            expected = np.clip(to_the_limit, -fastest, fastest)
            np.testing.assert_allclose(bound, expected, atol=1e-9)
            assert (expected == to_the_limit).any()
            assert (expected != to_the_limit).any()

    @given(seeds)
    @settings(max_examples=10)
    def test_accelerations_lead_to_the_limits_after_the_horizons(self, seed):
        """Uniformly accelerated: s + h s_dot + h^2/2 s_ddot is at its limit, or the speed is."""
        case, speed_horizon, horizon = self.extreme(seed), 0.005, 0.02
        limits = AccelerationLimits(ROBOT, speed_horizon, horizon)
        problem = posed(N + 12, case, limits=[limits])
        s, s_dot = case.state.joint_position, case.state.joint_velocity
        for bound, limit, side in (
            (problem.lower[:N], ROBOT.lower_position, -1.0),
            (problem.upper[:N], ROBOT.upper_position, 1.0),
        ):
            position = s + horizon * s_dot + horizon**2 / 2 * bound
            speed = s_dot + speed_horizon * bound
            at_the_limit = np.isclose(position, limit, atol=1e-9)
            at_top_speed = np.isclose(np.abs(speed), ROBOT.velocity_limit, atol=1e-9)
            assert (at_the_limit | at_top_speed).all()
            assert at_the_limit.any()
            assert at_top_speed.any()
            # Never faster; and beyond the position limit only where the speed allows no less.
            assert (np.abs(speed) <= ROBOT.velocity_limit + 1e-9).all()
            beyond = side * (position - limit) > 1e-9
            np.testing.assert_allclose(speed[beyond], -side * ROBOT.velocity_limit[beyond])

    def test_torques_are_bounded_in_both_directions(self):
        case = Case(0)
        problem = posed(N + 12, case, limits=[TorqueLimits(case.dynamics, ROBOT)])
        x = unknowns(case, N + 12)
        torque = case.oracle.forces(x[:N], x[N:])[6:]
        slack = problem.upper[N + 12 :] - problem.C @ x, problem.C @ x - problem.lower[N + 12 :]
        np.testing.assert_allclose(slack[0], ROBOT.effort_limit - torque, atol=1e-8)
        np.testing.assert_allclose(slack[1], ROBOT.effort_limit + torque, atol=1e-8)

    def test_each_foot_has_its_cone_and_least_force(self):
        case, config = Case(0), ContactConfig(minimum_force=17.0)
        problem = posed(N + 12, case, limits=[ContactLimits(config, ROBOT)])
        cone, x = contact_rows(config, ROBOT.sole), unknowns(case, N + 12)
        left, right = x[N : N + 6], x[N + 6 :]
        np.testing.assert_allclose(problem.C @ x, np.concatenate((cone @ left, cone @ right)))
        assert not problem.upper[N + 12 :].any()
        assert (problem.lower[N + 12 :] < -1e5).all()
        normal = np.zeros(N + 12, dtype=bool)
        normal[[N + 2, N + 8]] = True
        assert (problem.lower[: N + 12][normal] == 17.0).all()
        assert (problem.lower[: N + 12][~normal] < -1e5).all()
        assert (problem.upper[: N + 12] > 1e5).all()


def test_with_its_residual_unknown_an_equation_is_soft():
    """The same solution as that of (3b) and (3d) without feedback as costs."""
    case = Case(2)
    kinematics, posture = case.kinematics, PostureVelocity(2.0, case.weights)
    centroidal, apart = CentroidalVelocity(kinematics, 30.0, 20.0), SolesApart(kinematics)
    momentum = MomentumIntegral(kinematics, 0.0, 20.0, np.zeros(3))
    soft = TaskQP(
        N,
        costs=[posture],
        soft=[ComVelocity(kinematics, 0.0, 30.0), momentum],
        hard=[apart],
        limits=[],
        solver="daqp",
    )
    residual_unknown = TaskQP(
        N + 6,
        costs=[posture, centroidal],
        soft=[],
        hard=[centroidal, apart],
        limits=[],
        solver="daqp",
    )
    expected, x = (qp.solve(case.state, case.wanted)[0].x for qp in (soft, residual_unknown))
    np.testing.assert_allclose(x[:N], expected, atol=1e-9)
    wanted = np.concatenate((case.wanted.com_velocity, case.wanted.angular_momentum))
    np.testing.assert_allclose(x[N:], wanted - kinematics.centroidal_map @ expected, atol=1e-9)
    assert np.abs(x[N:]).max() > 1e-3


@pytest.mark.parametrize("speed", [-0.2, 0.0, 0.3])
def test_soles_go_apart_along_the_vertical_alone(speed):
    """Twists of both soles from Pinocchio, for joint velocities that fulfil the equation."""
    case = Case(3)
    task = SolesApart(case.kinematics)
    task.speed = speed
    rows, target = np.zeros((6, N)), np.zeros(6)
    task.write(case.state, case.wanted, rows, target)
    s_dot = np.linalg.lstsq(rows, target, rcond=None)[0]
    oracle = case.oracle
    nu = np.concatenate((np.zeros(6), s_dot))
    left, right = (
        placement.rotation @ (J @ nu)[part]
        for placement, J in zip(oracle.placements, oracle.J, strict=True)
        for part in (slice(3),)
    )
    turns = [
        placement.rotation @ (J @ nu)[3:]
        for placement, J in zip(oracle.placements, oracle.J, strict=True)
    ]
    # Where both turn alike with the base at rest, the line between the soles turns, too.
    line = oracle.placements[1].translation - oracle.placements[0].translation
    np.testing.assert_allclose(turns[1], turns[0], atol=1e-9)
    apart = right - left - np.cross(turns[0], line)
    np.testing.assert_allclose(apart, [0.0, 0.0, speed], atol=1e-9)
