"""Eq. 6: against the textbook form, its constraints, and when the solver fails."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import jump
from hypothesis import given, settings
from hypothesis import strategies as st
from icub_jump_env.control.contact import ContactLimits, contact_rows

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.qp.problem import QPStatus, QuadraticProgram, check_solution
from icub_jump_env.control.qp.solvers import make_solver
from icub_jump_env.control.torque import TorqueController, TorqueGains
from icub_jump_env.errors import ConfigError
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.evaluation.rollout import make_env
from icub_jump_env.planning.reference import ComReference
from icub_jump_env.planning.scaled_curve import plan_com_trajectory
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()

N = ROBOT.n_joints
model = build_pinocchio_model(ROBOT)
LIMITS = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
SOLE = ROBOT.sole


class Case:
    """A controller, an estimator on a moving robot with both feet on the floor, a reference."""

    def __init__(self, seed, time=0.3, **options):
        rng = np.random.default_rng(seed)
        s = ROBOT.crouch.copy()
        stance = rng.normal(scale=0.02, size=3)
        s[[0, 3, 4]] += stance
        s[[6, 9, 10]] += stance
        s[ROBOT.torso] += rng.normal(scale=0.02, size=3)
        s[ROBOT.arms] += rng.normal(scale=0.02, size=8)
        s = np.clip(s, LIMITS[0] + 0.02, LIMITS[1] - 0.02)
        kinematics = FeetFixedKinematics(ROBOT)
        kinematics.update(s)
        # Joint velocities that leave both feet at rest.
        _, _, Vt = np.linalg.svd(kinematics.J_feet)
        s_dot = Vt[6:].T @ (0.3 * rng.normal(size=17))
        self.s, self.s_dot = s, s_dot
        self.estimator = FeetFixedEstimator(kinematics)
        self.estimator.update(s, s_dot)
        self.holding = rng.normal(size=N)
        self.subject = TorqueController(
            ROBOT.crouch, self.holding, LIMITS, FeetFixedDynamics(kinematics), **options
        )
        self.reference = ComReference()
        trajectory = plan_com_trajectory(0.04)
        start = self.estimator.com - [0, 0, trajectory.sample(time).position]
        self.reference.reset(trajectory, start + 0.002 * rng.normal(size=3))
        self.reference.update(time)

    def tick(self):
        command = self.subject.command(self.estimator, self.s, self.s_dot, self.reference)
        return command.torque


def textbook(case, gains, contact, momentum_control):
    """Eq. 6 in the paper's unknowns u = (tau, f), from Pinocchio alone.

    nu_dot = M^-1 (B tau + J_f^T f - h) is substituted everywhere, as the paper does. The
    CoM and momentum rows carry the controller's weights.
    """
    kinematics = case.estimator.kinematics
    quaternion = pin.Quaternion(kinematics.base_rotation).coeffs()
    q = np.concatenate((kinematics.base_position, quaternion, case.s))
    soles = [model.getFrameId(frame) for frame in ROBOT.sole_frames]
    J = [pin.computeFrameJacobian(model, model.createData(), q, i) for i in soles]
    base = -np.linalg.solve(J[0][:, :6], J[0][:, 6:] @ case.s_dot)
    nu = np.concatenate((base, case.s_dot))
    data = model.createData()
    pin.forwardKinematics(model, data, q, nu, np.zeros(model.nv))
    pin.updateFramePlacements(model, data)
    drift = [pin.getFrameAcceleration(model, data, i).vector for i in soles]
    placements = [data.oMf[i].copy() for i in soles]
    M = pin.crba(model, model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    h = pin.nonLinearEffects(model, model.createData(), q, nu)
    h[6:] += np.array(model.damping[6:]) * case.s_dot

    B = np.vstack((np.zeros((6, N)), np.eye(N)))
    inputs = np.hstack((B, J[0].T, J[1].T))
    A_nu = np.linalg.solve(M, inputs)  # nu_dot = A_nu u + a_nu
    a_nu = -np.linalg.solve(M, h)

    com = pin.centerOfMass(model, model.createData(), q)
    J_com = pin.jacobianCenterOfMass(model, model.createData(), q)
    data = model.createData()
    pin.centerOfMass(model, data, q, nu, np.zeros(model.nv))
    J_com_dot_nu = data.acom[0]
    reference, estimator = case.reference, case.estimator
    wanted = (
        reference.acceleration
        - gains.com_stiffness * (com - reference.position)
        - gains.com_damping * (estimator.com_velocity - reference.velocity)
    )
    tasks = [(J_com @ A_nu, wanted - J_com_dot_nu - J_com @ a_nu, gains.com_weight)]
    if momentum_control:
        A = np.zeros((3, N + 12))
        for foot, placement in enumerate(placements):
            R, arm = placement.rotation, placement.translation - com
            A[:, N + 6 * foot : N + 6 * foot + 3] = pin.skew(arm) @ R
            A[:, N + 6 * foot + 3 : N + 6 * foot + 6] = R
        tasks.append((A, -gains.momentum * estimator.angular_momentum, gains.momentum_weight))
    posture = (
        gains.posture_stiffness * (ROBOT.crouch - case.s) - gains.posture_damping * case.s_dot
    )
    H = np.zeros((N + 12, N + 12))
    g = np.zeros(N + 12)
    for rows, target, weight in (
        *((r, t, np.full(3, w)) for r, t, w in tasks),
        (A_nu[6:], posture - a_nu[6:], np.array(gains.posture_weight)),
        (np.eye(N, N + 12), case.holding, np.array(gains.continuity_weight)),
        (np.eye(N + 12)[N:], np.zeros(12), np.full(12, gains.wrench_weight)),
    ):
        H += rows.T @ (weight[:, None] * rows)
        g -= rows.T @ (weight * target)

    cone = contact_rows(contact)
    problem = QuadraticProgram(N + 12, n_inequalities=2 * len(cone), n_equalities=12)
    problem.H[:], problem.g[:] = H, g
    lower, upper = problem.lower, problem.upper
    lower[:N], upper[:N] = -ROBOT.effort_limit, ROBOT.effort_limit
    lower[N:], upper[N : N + 12] = -1e6, 1e6
    for foot in range(2):
        wrench = slice(N + 6 * foot, N + 6 * foot + 6)
        lower[wrench.start + 2] = contact.minimum_force
        problem.C[len(cone) * foot : len(cone) * (foot + 1), wrench] = cone
        rows = slice(problem.C.shape[0] - 12 + 6 * foot, problem.C.shape[0] - 6 + 6 * foot)
        problem.C[rows] = J[foot] @ A_nu
        still = slice(N + 12 + rows.start, N + 12 + rows.stop)
        lower[still] = upper[still] = -drift[foot] - J[foot] @ a_nu
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
    expected = textbook(case, TorqueGains(), ContactLimits(), momentum_control)
    np.testing.assert_allclose(torque, expected, atol=1e-5)


@given(st.integers(0, 1000), st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_constraints_hold_whatever_is_asked(seed, forward, upward):
    case = Case(seed)
    case.reference.acceleration[:] = [forward, 0.0, upward]
    torque = case.tick()
    assert (np.abs(torque) <= ROBOT.effort_limit).all()
    if not case.subject.report.failed:
        assert_contact_holds(case.subject.solution)


def assert_contact_holds(solution, limits=None):
    """Friction, unilateral force and CoP of both feet, written out by hand."""
    limits = limits or ContactLimits()
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
    assert (contact_rows(ContactLimits()) @ np.concatenate((force, moment)) <= 1e-9).all()


@pytest.mark.parametrize(
    ("x", "y", "slope"), [(0.12, 0, 0), (-0.06, 0, 0), (0, 0.04, 0), (0, -0.04, 0), (0, 0, 0.6)]
)
def test_a_force_outside_the_sole_or_cone_is_not(x, y, slope):
    force = 100.0 * np.array([slope, 0.0, 1.0])
    moment = np.cross([x, y, SOLE.bottom], force)
    assert (contact_rows(ContactLimits()) @ np.concatenate((force, moment)) > 0).any()


def test_solvers_give_the_same_torques():
    """To what OSQP's tolerance leaves open: how hard the feet squeeze towards each other."""
    for seed in range(5):
        torques = [Case(seed, solver=name).tick() for name in ("daqp", "osqp")]
        np.testing.assert_allclose(*torques, atol=5e-2)


def test_a_failed_solve_keeps_the_previous_torques():
    case = Case(0)
    checked = case.subject._solver._solver

    class Failing:
        tolerances = checked.tolerances

        def solve(self):
            return checked.solve()._replace(status=QPStatus.INFEASIBLE)

    first = case.tick()
    case.subject._solver._solver = Failing()
    case.reference.acceleration[2] += 3.0
    np.testing.assert_array_equal(case.tick(), first)
    assert case.subject.report.failed


def test_reset_forgets():
    used, fresh = Case(0), Case(0)
    used.reference.acceleration[2] += 3.0
    used.tick()
    used.subject.reset()
    used.reference.acceleration[2] -= 3.0
    np.testing.assert_allclose(used.tick(), fresh.tick(), atol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [("com_weight", -1.0), ("wrench_weight", 0.0), ("posture_weight", (1.0,)), ("momentum", "x")],
)
def test_bad_gains_are_refused(field, value):
    with pytest.raises(ConfigError) as refusal:
        dataclasses.replace(TorqueGains(), **{field: value})
    assert refusal.value.field == field


class TestNominalJump:
    def test_constraints_hold_at_every_tick(self):
        env = make_env(JumpConfig(controller="torque", agent_frequency=500.0))
        env.reset(seed=0)
        launch, ticks, terminated = env._controller._launch, 0, False
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
