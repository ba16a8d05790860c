"""Every task against Pinocchio, at moving robots and set points none of whose parts is zero."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from standing import GRAVITY, ROBOT, N, Oracle, Standing

from icub_jump_env.control.config import ContactConfig
from icub_jump_env.control.qp.problem import UNBOUNDED
from icub_jump_env.control.tasks.com import com_acceleration, com_velocity
from icub_jump_env.control.tasks.contact import contact_rows, limit_wrenches
from icub_jump_env.control.tasks.feet import feet_acceleration, feet_velocity
from icub_jump_env.control.tasks.least_squares import least_squares
from icub_jump_env.control.tasks.limits import (
    acceleration_limits,
    torque_limits,
    velocity_limits,
)
from icub_jump_env.control.tasks.momentum import momentum_integral, momentum_rate
from icub_jump_env.control.tasks.motion import base_motion
from icub_jump_env.control.tasks.posture import posture_acceleration, posture_velocity
from icub_jump_env.control.tasks.smoothness import torque_smoothness, velocity_smoothness
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.limits import JointLimits

seeds = st.integers(0, 10_000)
LIMITS = JointLimits.of(ROBOT).block[0]


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
        # What a compiled function calls the fields of a block.
        self.model, self.motion = self.kinematics.block[0], self.dynamics.block[0]
        self.believed, self.asked = self.state.block[0], self.wanted.block[0]
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
        write: The task: case, scale, rows, target.
        residual: Its residual at joint velocities, or at accelerations and wrenches.
        size: Number of its rows.
        n: Number of unknowns.
        world: Whether the residual is in world axes and the task in those of the base.
        scaled: Whether it has a weight.
    """

    write: Callable[..., None]
    residual: Callable[..., np.ndarray]
    size: int = 3
    n: int = N + 12
    world: bool = False
    scaled: bool = True

    def written(self, case, scale=1.0):
        """Rows and target, into buffers that were not clean where the task writes."""
        rows, target = np.zeros((self.size, self.n)), np.full(self.size, 7.0)
        self.write(case, scale, rows, target)
        return rows, target


EQUATIONS = {
    "(3b)": Equation(
        lambda c, scale, *out: com_velocity(c.model, c.asked, 7.0, scale, *out),
        lambda c, s_dot: (
            c.oracle.momentum(s_dot)[:3] / c.oracle.mass
            - (c.wanted.com_velocity - 7.0 * c.errors["com"])
        ),
        n=N,
    ),
    "(3d)": Equation(
        lambda c, scale, *out: momentum_integral(c.model, c.integral, c.asked, 9.0, scale, *out),
        lambda c, s_dot: (
            c.oracle.momentum(s_dot)[3:] - (c.wanted.angular_momentum - 9.0 * c.integral)
        ),
        n=N,
    ),
    "(3c)": Equation(
        lambda c, scale, *out: feet_velocity(c.model, 0.0, *out),
        lambda c, s_dot: -c.oracle.in_base_frame(c.oracle.J[1] @ c.oracle.velocity(s_dot)),
        size=6,
        n=N,
        scaled=False,
    ),
    "(6b)": Equation(
        lambda c, scale, *out: com_acceleration(
            c.motion, c.believed, c.asked, 150.0, 20.0, scale, *out
        ),
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
        lambda c, scale, *out: momentum_rate(c.motion, c.believed, c.asked, 9.0, scale, *out),
        lambda c, s_ddot, f: (
            c.oracle.contact(f)[3:] - c.wanted.angular_momentum_rate + 9.0 * c.errors["momentum"]
        ),
        world=True,
    ),
    "(6c)": Equation(
        lambda c, scale, *out: feet_acceleration(c.model, c.motion, *out),
        lambda c, s_ddot, f: (
            -c.oracle.in_base_frame(
                c.oracle.J[1] @ c.oracle.acceleration(s_ddot) + c.oracle.drift[1]
            )
        ),
        size=6,
        scaled=False,
    ),
    "base rows of (1)": Equation(
        lambda c, scale, *out: base_motion(c.motion, *out),
        lambda c, s_ddot, f: c.oracle.forces(s_ddot, f)[:6],
        size=6,
        scaled=False,
    ),
    "second term of (6a)": Equation(
        lambda c, scale, *out: torque_smoothness(c.motion, c.previous, c.weights, *out),
        lambda c, s_ddot, f: np.sqrt(c.weights) * (c.oracle.forces(s_ddot, f)[6:] - c.previous),
        size=N,
        scaled=False,
    ),
}


def unknowns(case, n):
    x = case.rng.normal(size=n)
    x[N:] *= 50.0  # forces
    return x


@pytest.mark.parametrize("name", EQUATIONS)
@settings(max_examples=5)
@given(seeds, st.floats(0.1, 100.0))
def test_an_equation_is_the_papers(name, seed, scale):
    case, equation = Case(seed), EQUATIONS[name]
    rows, target = equation.written(case, scale)
    factor = scale if equation.scaled else 1.0
    for _ in range(2):
        x = unknowns(case, equation.n)
        parts = (x,) if equation.n == N else (x[:N], x[N:])
        ours, theirs = (rows @ x - target) / factor, equation.residual(case, *parts)
        if equation.world:
            ours = case.world @ ours
        np.testing.assert_allclose(ours, theirs, atol=1e-9 * max(1.0, np.abs(theirs).max()))


@given(st.integers(0, 12), seeds)
def test_least_squares_are_the_square_of_their_residual(size, seed):
    """Hessian and gradient of 1/2 ||A x - b||^2 + 1/2 x^T D x + g^T x."""
    rng = np.random.default_rng(seed)
    A, b, D, g = (rng.normal(size=shape) for shape in ((size, 7), size, 7, 7))
    hessian, gradient = np.full((7, 7), 3.0), g.copy()
    least_squares(A, b, D, hessian, gradient)
    np.testing.assert_allclose(hessian, A.T @ A + np.diag(D), atol=1e-12)
    np.testing.assert_allclose(gradient, g - A.T @ b, atol=1e-12)
    np.testing.assert_array_equal(hessian, hessian.T)


def test_the_wrenches_that_fulfil_6b_and_6d_give_the_com_and_the_momentum_these_rates():
    """Newton and Euler hold: with the base rows, forces are accelerations."""
    case = Case(1)
    names = ("(6b)", "(6d)", "(6c)", "base rows of (1)")
    written = [EQUATIONS[name].written(case) for name in names]
    rows, target = (np.concatenate(parts) for parts in zip(*written, strict=True))
    x = np.linalg.lstsq(rows, target)[0]
    np.testing.assert_allclose(rows @ x, target, atol=1e-8)
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
        lambda c, g: posture_velocity(c.believed, c.asked, 2.0, c.weights, g),
        lambda c: c.weights * (-c.wanted.posture_velocity + 2.0 * c.errors["posture"]),
    ),
    "second term of (3a)": (
        lambda c, g: velocity_smoothness(c.previous, c.weights, g),
        lambda c: c.weights * -c.previous,
    ),
    "first term of (6a)": (
        lambda c, g: posture_acceleration(c.believed, c.asked, 12.0, 5.0, c.weights, g),
        lambda c: (
            c.weights
            * (
                -c.wanted.posture_acceleration
                + 12.0 * c.errors["posture"]
                + 5.0 * c.errors["posture_velocity"]
            )
        ),
    ),
}


@pytest.mark.parametrize("name", COSTS)
@given(seeds)
@settings(max_examples=5)
def test_a_cost_pulls_towards_its_goal(name, seed):
    """Its gradient where the unknowns are zero, added to what was there."""
    case = Case(seed)
    subtract, expected = COSTS[name]
    before = case.rng.normal(size=N)
    gradient = before.copy()
    subtract(case, gradient)
    np.testing.assert_allclose(gradient - before, expected(case), atol=1e-9)


class TestLimits:
    def extreme(self, seed):
        """A case whose joints are close to one of their limits or beyond, at any speed."""
        case = Case(seed)
        rng = case.rng
        limit = np.where(rng.random(N) < 0.5, ROBOT.lower_position, ROBOT.upper_position)
        case.state.joint_position[:] = limit + rng.uniform(-0.1, 0.1, N)
        case.state.joint_velocity[:] = ROBOT.velocity_limit * rng.uniform(-1.1, 1.1, N)
        return case

    @given(seeds)
    @settings(max_examples=10)
    def test_velocities_end_where_the_speed_or_the_position_after_the_horizon_does(self, seed):
        case, horizon = self.extreme(seed), 0.02
        lower, upper = np.zeros((2, N))
        velocity_limits(LIMITS, case.believed, horizon, 0.9, lower, upper)
        fastest = 0.9 * ROBOT.velocity_limit
        for bound, limit in ((lower, ROBOT.lower_position), (upper, ROBOT.upper_position)):
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
        lower, upper = np.zeros((2, N))
        acceleration_limits(LIMITS, case.believed, speed_horizon, horizon, lower, upper)
        s, s_dot = case.state.joint_position, case.state.joint_velocity
        for bound, limit, side in (
            (lower, ROBOT.lower_position, -1.0),
            (upper, ROBOT.upper_position, 1.0),
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
        rows, (lower, upper) = np.zeros((N, N + 12)), np.zeros((2, N))
        torque_limits(LIMITS, case.motion, rows, lower, upper)
        x = unknowns(case, N + 12)
        torque = case.oracle.forces(x[:N], x[N:])[6:]
        np.testing.assert_allclose(upper - rows @ x, ROBOT.effort_limit - torque, atol=1e-8)
        np.testing.assert_allclose(rows @ x - lower, ROBOT.effort_limit + torque, atol=1e-8)

    def test_each_foot_has_its_cone_and_least_force(self):
        config, f = ContactConfig(minimum_force=17.0), np.random.default_rng(0).normal(size=12)
        rows, (lower, upper), least = np.zeros((20, 12)), np.ones((2, 20)), np.full(12, -1.0)
        limit_wrenches(config, ROBOT.sole, rows, lower, upper, least)
        cone = contact_rows(config, ROBOT.sole)
        np.testing.assert_allclose(rows @ f, np.concatenate((cone @ f[:6], cone @ f[6:])))
        assert not upper.any()
        assert (lower == -UNBOUNDED).all()
        normal = np.zeros(12, dtype=bool)
        normal[[2, 8]] = True
        assert (least[normal] == 17.0).all()
        assert (least[~normal] == -1.0).all()


@pytest.mark.parametrize("speed", [-0.2, 0.0, 0.3])
def test_soles_go_apart_along_the_vertical_alone(speed):
    """Twists of both soles from Pinocchio, for joint velocities that fulfil the equation."""
    case = Case(3)
    rows, target = np.zeros((6, N)), np.zeros(6)
    feet_velocity(case.model, speed, rows, target)
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
