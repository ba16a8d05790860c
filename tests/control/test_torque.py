"""Eq. 6: against the textbook form, its constraints, and when the solver fails."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import jump
from hypothesis import given, settings
from hypothesis import strategies as st
from standing import GRAVITY, MODEL, ROBOT, STANCE, N, Oracle, Standing

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ContactConfig, TorqueConfig
from icub_jump_env.control.phases import Phase
from icub_jump_env.control.qp.check import check_solution
from icub_jump_env.control.qp.problem import QPStatus, QuadraticProgram
from icub_jump_env.control.qp.solvers import make_solver
from icub_jump_env.control.tasks.contact import contact_rows
from icub_jump_env.control.torque import TorqueController
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.planning.scaled_curve import ScaledCurvePlan, plan_com_trajectory

SOLE = ROBOT.sole


class Case:
    """A controller, and a robot that is somewhere near the plan at ``time`` (s)."""

    def __init__(self, seed, time=0.3, **options):
        self.standing = standing = Standing(seed)
        self.stance = STANCE._replace(torque=standing.rng.normal(size=N))
        self.config = TorqueConfig(**options)
        self.subject = TorqueController(self.config, standing.kinematics)
        self.subject.reset(self.stance)
        planned = ScaledCurvePlan(plan_com_trajectory(0.04), ROBOT, STANCE).sample(time)
        self.wanted = standing.setpoint
        self.wanted.com_velocity[:] = planned.com_velocity
        self.wanted.com_acceleration[:] = planned.com_acceleration
        self.wanted.com_position += 0.002 * standing.rng.normal(size=3)

    def ask_for_what_can_be_had(self):
        """Every part of the set point is asked for, none far from what the robot does."""
        self.standing.ask(size=0.1)
        state, noise = self.standing.state, self.standing.rng.normal
        self.wanted.com_velocity[:] = state.com_velocity + 0.01 * noise(size=3)
        self.wanted.angular_momentum[:] = state.angular_momentum + 0.1 * noise(size=3)

    def tick(self):
        return self.subject.command(self.standing.state, self.wanted).torque


def textbook(case, previous):
    """Eq. 6 in the paper's unknowns u = (tau, f), from Pinocchio alone.

    nu_dot = M^-1 (B tau + J_f^T f - h) is substituted everywhere, as the paper does. The
    CoM and momentum rows are constraints, or carry the controller's weights.
    """
    config, wanted, state = case.config, case.wanted, case.standing.state
    oracle = Oracle(case.standing)
    q, nu, J, com = oracle.q, oracle.nu, oracle.J, oracle.com
    s_dot = nu[6:]
    M = pin.crba(MODEL, MODEL.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    h = pin.nonLinearEffects(MODEL, MODEL.createData(), q, nu)
    h[6:] += np.array(MODEL.damping[6:]) * s_dot

    B = np.vstack((np.zeros((6, N)), np.eye(N)))
    inputs = np.hstack((B, J[0].T, J[1].T))
    A_nu = np.linalg.solve(M, inputs)  # nu_dot = A_nu u + a_nu
    a_nu = -np.linalg.solve(M, h)

    J_com = pin.jacobianCenterOfMass(MODEL, MODEL.createData(), q)
    data = MODEL.createData()
    pin.centerOfMass(MODEL, data, q, nu, np.zeros(MODEL.nv))
    J_com_dot_nu = data.acom[0]
    velocity, momentum = np.split(oracle.momentum(s_dot), 2)
    acceleration = (
        wanted.com_acceleration
        - config.com_stiffness * (com - wanted.com_position)
        - config.com_damping * (velocity / oracle.mass - wanted.com_velocity)
    )
    tasks = [(J_com @ A_nu, acceleration - J_com_dot_nu - J_com @ a_nu, config.com_weight)]
    if config.momentum_control:
        A = np.zeros((3, N + 12))
        for foot, placement in enumerate(oracle.placements):
            R, arm = placement.rotation, placement.translation - com
            A[:, N + 6 * foot : N + 6 * foot + 3] = pin.skew(arm) @ R
            A[:, N + 6 * foot + 3 : N + 6 * foot + 6] = R
        error = momentum - wanted.angular_momentum
        rate = wanted.angular_momentum_rate - config.momentum * error
        tasks.append((A, rate, config.momentum_weight))
    posture = (
        wanted.posture_acceleration
        - config.posture_stiffness * (state.joint_position - wanted.posture)
        - config.posture_damping * (s_dot - wanted.posture_velocity)
    )
    H = np.zeros((N + 12, N + 12))
    g = np.zeros(N + 12)
    hard = config.constraints == "hard"
    for rows, target, weight in (
        *((r, t, np.full(3, w)) for r, t, w in tasks if not hard),
        (A_nu[6:], posture - a_nu[6:], ROBOT.per_joint("", config.posture_weight)),
        (np.eye(N, N + 12), previous, ROBOT.per_joint("", config.smoothness_weight)),
        (np.eye(N + 12)[N:], np.zeros(12), np.full(12, config.wrench_weight)),
    ):
        H += rows.T @ (weight[:, None] * rows)
        g -= rows.T @ (weight * target)

    equalities = [(J[f] @ A_nu, -oracle.drift[f] - J[f] @ a_nu) for f in range(2)]
    if hard:
        equalities += [(rows, target) for rows, target, _ in tasks]
    contact = config.contact
    cone = contact_rows(contact, SOLE)
    rows, targets = (np.concatenate(parts) for parts in zip(*equalities, strict=True))
    problem = QuadraticProgram(N + 12, n_inequalities=2 * len(cone), n_equalities=len(rows))
    problem.H[:], problem.g[:] = H, g
    lower, upper = problem.lower, problem.upper
    lower[:N], upper[:N] = -ROBOT.effort_limit, ROBOT.effort_limit
    upper[N + 12 : N + 12 + 2 * len(cone)] = 0.0
    for foot in range(2):
        wrench = slice(N + 6 * foot, N + 6 * foot + 6)
        lower[wrench.start + 2] = contact.minimum_force
        problem.C[len(cone) * foot : len(cone) * (foot + 1), wrench] = cone
    problem.C[-len(rows) :] = rows
    lower[-len(rows) :] = upper[-len(rows) :] = targets
    solution = make_solver("daqp", problem).solve()
    residuals = check_solution(problem, solution)
    assert solution.status is QPStatus.SOLVED
    assert residuals.primal < 1e-6
    assert residuals.dual < 1e-8
    return solution.x[:N]


@settings(max_examples=15)
@given(st.integers(0, 1000), st.booleans(), st.floats(0.0, 0.42))
def test_equals_the_textbook_form(seed, momentum_control, time):
    case = Case(seed, time, momentum_control=momentum_control)
    torque = case.tick()
    assert case.subject.report.status is QPStatus.SOLVED
    np.testing.assert_allclose(torque, textbook(case, case.stance.torque), atol=1e-5)


@settings(max_examples=15)
@given(st.integers(0, 1000), st.sampled_from(["soft", "hard"]))
def test_equals_the_textbook_form_at_any_weights_gains_and_set_points(seed, constraints):
    """None of which is zero, also at a second tick."""
    draw = np.random.default_rng(seed).uniform
    case = Case(
        seed,
        constraints=constraints,
        com_weight=10 ** draw(0.0, 4.0),
        momentum_weight=10 ** draw(-1.0, 3.0),
        posture_weight=tuple(draw(0.1, 2.0, 3)),
        smoothness_weight=tuple(10 ** draw(-4.0, -2.0, N)),
        wrench_weight=10 ** draw(-4.0, -2.0),
        posture_stiffness=draw(1.0, 20.0),
        posture_damping=draw(1.0, 10.0),
        com_stiffness=draw(10.0, 300.0),
        com_damping=draw(5.0, 40.0),
        momentum=draw(1.0, 15.0),
        contact=ContactConfig(friction=draw(0.4, 0.8), minimum_force=draw(5.0, 30.0)),
    )
    case.ask_for_what_can_be_had()
    previous = case.stance.torque
    for _ in range(2):
        torque = case.tick()
        assert case.subject.report.status is QPStatus.SOLVED
        np.testing.assert_allclose(torque, textbook(case, previous), atol=1e-5)
        previous = torque


@given(st.integers(0, 1000), st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_constraints_hold_whatever_is_asked(seed, forward, upward):
    case = Case(seed)
    case.wanted.com_acceleration[:] = [forward, 0.0, upward]
    torque = case.tick()
    assert (np.abs(torque) <= ROBOT.effort_limit).all()
    if not case.subject.report.failed:
        assert_contact_holds(case.subject.solution)


def assert_contact_holds(solution, limits=None):
    """Friction, unilateral force and CoP of both feet, written out by hand."""
    limits = limits or ContactConfig()
    for foot in range(2):
        Fx, Fy, Fz, Mx, My, Mz = solution[N + 6 * foot : N + 6 * foot + 6]
        assert Fz >= limits.minimum_force - 1e-6
        assert max(abs(Fx), abs(Fy)) <= limits.friction * Fz + 1e-6
        assert abs(Mz) <= limits.torsional_friction * Fz + 1e-6
        z = SOLE.bottom
        cop = (z * Fx - My) / Fz, (z * Fy + Mx) / Fz
        assert SOLE.x_min - 1e-6 <= cop[0] <= SOLE.x_max + 1e-6
        assert abs(cop[1]) <= SOLE.half_width + 1e-6


@given(
    st.floats(SOLE.x_min, SOLE.x_max), st.floats(-SOLE.half_width, SOLE.half_width),
    st.floats(-0.49, 0.49), st.floats(-0.49, 0.49), st.floats(20.0, 500.0),
)  # fmt: skip
def test_a_force_inside_the_sole_and_cone_is_allowed(x, y, slope_x, slope_y, normal):
    force = normal * np.array([slope_x, slope_y, 1.0])
    moment = np.cross([x, y, SOLE.bottom], force)
    moment[2] = 0.0
    assert (contact_rows(ContactConfig(), SOLE) @ np.concatenate((force, moment)) <= 1e-9).all()


@pytest.mark.parametrize(
    ("x", "y", "slope"), [(0.12, 0, 0), (-0.06, 0, 0), (0, 0.04, 0), (0, -0.04, 0), (0, 0, 0.6)]
)
def test_a_force_outside_the_sole_or_cone_is_not(x, y, slope):
    force = 100.0 * np.array([slope, 0.0, 1.0])
    moment = np.cross([x, y, SOLE.bottom], force)
    assert (contact_rows(ContactConfig(), SOLE) @ np.concatenate((force, moment)) > 0).any()


def test_solvers_give_the_same_torques():
    """To what OSQP's tolerance leaves open: how hard the feet squeeze towards each other."""
    for seed in range(5):
        torques = [Case(seed, solver=name).tick() for name in ("daqp", "osqp")]
        np.testing.assert_allclose(*torques, atol=5e-2)


def test_a_failed_solve_keeps_the_previous_torques():
    case = Case(0)
    checked = case.subject.qp._solver._solver

    class Failing:
        tolerances = checked.tolerances

        def solve(self):
            return checked.solve()._replace(status=QPStatus.INFEASIBLE)

    first = case.tick()
    case.subject.qp._solver._solver = Failing()
    case.wanted.com_acceleration[2] += 3.0
    np.testing.assert_array_equal(case.tick(), first)
    assert case.subject.report.failed


def test_reset_forgets():
    used, fresh = Case(0), Case(0)
    used.wanted.com_acceleration[2] += 3.0
    used.tick()
    used.subject.reset(used.stance)
    used.wanted.com_acceleration[2] -= 3.0
    np.testing.assert_allclose(used.tick(), fresh.tick(), atol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("com_weight", -1.0),
        ("wrench_weight", 0.0),
        ("posture_weight", (0.0,) * 3),
        ("momentum", "x"),
        ("contact", {}),
        ("smoothness_weight", 1e-3),
        ("kind", "velocity"),
        ("speed_horizon", 0.0),
    ],
)
def test_bad_gains_are_refused(field, value):
    with pytest.raises(ConfigError) as refusal:
        dataclasses.replace(TorqueConfig(), **{field: value})
    assert refusal.value.field == field


class TestHardConstraints:
    """Eq. 6 as printed."""

    @given(st.integers(0, 1000))
    @settings(max_examples=15)
    def test_com_and_momentum_hold_where_they_can(self, seed):
        case = Case(seed, constraints="hard")
        case.ask_for_what_can_be_had()
        case.tick()
        assert case.subject.report.status is QPStatus.SOLVED
        oracle, config, wanted = Oracle(case.standing), case.config, case.wanted
        force, moment = np.split(oracle.contact(case.subject.solution[N:]), 2)
        velocity, momentum = np.split(oracle.momentum(oracle.nu[6:]), 2)
        acceleration = (
            wanted.com_acceleration
            - config.com_stiffness * (oracle.com - wanted.com_position)
            - config.com_damping * (velocity / oracle.mass - wanted.com_velocity)
        )
        np.testing.assert_allclose(force / oracle.mass + GRAVITY, acceleration, atol=1e-6)
        error = momentum - wanted.angular_momentum
        rate = wanted.angular_momentum_rate - config.momentum * error
        np.testing.assert_allclose(moment, rate, atol=1e-6)

    def test_an_impossible_tick_is_a_failure_answered_by_the_soft_qp(self):
        """Bit for bit, and the tick after it goes on from there."""
        hard, soft = (Case(3, constraints=constraints) for constraints in ("hard", "soft"))
        for case in (hard, soft):
            case.wanted.com_acceleration[:] = [60.0, 0.0, 60.0]
        answers = [case.tick() for case in (hard, soft)]
        assert hard.subject.report.status is QPStatus.INFEASIBLE
        assert not soft.subject.report.failed
        np.testing.assert_array_equal(*answers)
        np.testing.assert_array_equal(hard.subject.solution, soft.subject.solution)
        assert np.abs(answers[0] - hard.stance.torque).max() > 1.0
        hard.ask_for_what_can_be_had()
        hard.tick()
        assert not hard.subject.report.failed


def test_a_wrong_number_of_weights_is_refused():
    for field in ("posture_weight", "smoothness_weight"):
        with pytest.raises(ConfigError, match=r"3 weights .* or 23") as refusal:
            Case(0, **{field: (1.0,) * 22})
        assert refusal.value.field == field


class TestNominalJump:
    def test_constraints_hold_at_every_tick(self):
        env = make_env(JumpConfig(controller="torque", agent_frequency=500.0))
        env.reset(seed=0)
        launch = env._controller._controllers[Phase.LAUNCH]._controller
        ticks, terminated = 0, False
        while not terminated:
            _, _, terminated, _, info = env.step(np.zeros(3, np.float32))
            if info["phase"] == "launch":
                assert_contact_holds(launch.solution)
                assert info["solver_primal_residual"] <= 1e-6
                assert (np.abs(env.data.ctrl) <= ROBOT.effort_limit).all()
                ticks += 1
        assert ticks > 200
        assert info["jump"]["solver_failures"] == 0.0
        assert info["jump"]["limit_violations"] == 0.0
        assert info["jump"]["flight_height"] >= 0.030
        assert info["jump"]["sole_height"] >= 0.023
        assert info["is_success"]
        env.close()

    def test_momentum_ablation(self):
        with_, without = (
            jump(controller="torque", momentum_control=on, stand_time=1.0) for on in (True, False)
        )
        rotation, free = (abs(np.degrees(e.jump["flight_rotation"])) for e in (with_, without))
        assert rotation <= 1.0
        assert free >= rotation + 2.0

    @pytest.mark.parametrize(
        "change",
        [
            {"timestep": 1e-4},
            {"solver": "osqp"},
            {"jump_height": 0.02},
            {"com_displacement": 0.08},
        ],
    )
    def test_also_jumps(self, change):
        episode = jump(controller="torque", stand_time=0.5, **change)
        assert episode.is_success
        assert episode.jump["solver_failures"] == 0.0
