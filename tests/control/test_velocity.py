"""Eq. 3: against the textbook form, at the limits, and when the solver fails."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from standing import MODEL, ROBOT, STANCE, N, Oracle, Standing

from icub_jump_env.control.config import VelocityConfig
from icub_jump_env.control.qp.problem import QPSolution, QPStatus
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.errors import ConfigError

DT = 0.005
com_velocities = st.tuples(
    st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(0.0, 0.3)
).map(np.array)
seeds = st.integers(0, 1000)


def controller(standing, **options):
    return VelocityController(VelocityConfig(**options), standing.kinematics)


def tick(subject, standing, com_velocity=None):
    """The joint velocities that the controller commands."""
    if com_velocity is not None:
        standing.setpoint.com_velocity[:] = com_velocity
    return subject.command(standing.state, standing.setpoint).velocity


def textbook(standing, config, previous, integral):
    """Eq. 3 in nu = (base, joints), from Pinocchio alone, its optimality system solved exactly.

    Valid where no limit is active. The feet are hard; the CoM and momentum rows are, too, or
    carry the controller's weights.
    """
    oracle, wanted = Oracle(standing), standing.setpoint
    data = MODEL.createData()
    pin.computeCentroidalMap(MODEL, data, oracle.q)
    com_error = oracle.com - wanted.com_position
    rows = [data.Ag[:3] / oracle.mass]
    targets = [wanted.com_velocity - config.com * com_error]
    weights = [config.com_weight]
    if config.momentum_control:
        rows.append(data.Ag[3:].copy())
        targets.append(wanted.angular_momentum - config.momentum * integral)
        weights.append(config.momentum_weight)
    Lambda = ROBOT.per_joint("posture_weight", config.posture_weight)
    Delta = ROBOT.per_joint("smoothness_weight", config.smoothness_weight)
    H = np.zeros((N + 6, N + 6))
    H[6:, 6:] = np.diag(Lambda + Delta)
    g = np.zeros(N + 6)
    posture_error = standing.state.joint_position - wanted.posture
    desired = wanted.posture_velocity - config.posture * posture_error
    g[6:] = -(Lambda * desired + Delta * previous)
    equations, right = np.vstack(oracle.J), np.zeros(12)
    for row, target, weight in zip(rows, targets, weights, strict=True):
        if config.constraints == "hard":
            equations, right = np.vstack((equations, row)), np.append(right, target)
        else:
            H += weight * row.T @ row
            g -= weight * row.T @ target
    m = len(right)
    kkt = np.block([[H, equations.T], [equations, np.zeros((m, m))]])
    # A second solve against the residual makes up for the spread of the weights.
    right = np.append(-g, right)
    solution = np.linalg.solve(kkt, right)
    solution += np.linalg.solve(kkt, right - kkt @ solution)
    return solution[6 : N + 6]


@given(seeds, st.booleans(), st.sampled_from(["soft", "hard"]))
def test_equals_the_textbook_form_where_no_limit_is_active(seed, momentum_control, constraints):
    """At set points and weights none of which is zero, also at a second tick."""
    standing = Standing(seed)
    standing.ask(size=0.5)
    draw = standing.rng.uniform
    config = VelocityConfig(
        momentum_control=momentum_control,
        constraints=constraints,
        com=draw(1.0, 10.0),
        momentum=draw(1.0, 10.0),
        posture=draw(0.5, 3.0),
        com_weight=10 ** draw(0.0, 5.0),
        momentum_weight=10 ** draw(-1.0, 3.0),
        posture_weight=tuple(draw(0.1, 2.0, 3)),
        smoothness_weight=tuple(draw(0.1, 2.0, N)),
    )
    subject = VelocityController(config, standing.kinematics)
    previous, integral = np.zeros(N), np.zeros(3)
    for _ in range(2):
        command = tick(subject, standing)
        assert subject.report.status is QPStatus.SOLVED
        integral += (standing.state.angular_momentum - standing.setpoint.angular_momentum) * DT
        expected = textbook(standing, config, previous, integral)
        assert (np.abs(expected) < 0.9 * ROBOT.velocity_limit).all()
        np.testing.assert_allclose(command, expected, atol=1e-7)
        previous = command


def test_the_com_is_that_of_the_joints_with_the_feet_at_rest():
    """Also where an estimator believes that the robot turns about the edges of its feet."""
    standing, turning = Standing(5), Standing(5)
    turning.state.com[:] += [0.03, -0.01, 0.005]
    turning.state.com_velocity[:] += [0.2, 0.1, 0.0]
    commands = [tick(controller(each), each) for each in (standing, turning)]
    np.testing.assert_array_equal(*commands)
    assert np.abs(commands[0]).max() > 0.0


def test_momentum_control_off_removes_the_momentum_rows_and_nothing_else():
    """With a momentum weight of zero the full problem is the reduced one."""
    standing = Standing(7)
    velocity = np.array([0.0, 0.0, 0.2])
    without = controller(standing, momentum_control=False)
    weightless = controller(standing, momentum_weight=0.0)
    np.testing.assert_allclose(
        tick(without, standing, velocity), tick(weightless, standing, velocity), atol=1e-12
    )
    for field in ("lower", "upper", "C"):
        np.testing.assert_array_equal(
            getattr(without.qp.problem, field), getattr(weightless.qp.problem, field)
        )


@given(seeds, com_velocities)
def test_tasks_hold_where_no_limit_is_active(seed, com_velocity):
    standing, config = Standing(seed), VelocityConfig()
    subject = controller(standing)
    off = np.array([0.001, 0.0, 0.002])
    standing.setpoint.com_position += off
    command = tick(subject, standing, com_velocity)
    kinematics = standing.kinematics
    wanted = com_velocity + config.com * off
    np.testing.assert_allclose(kinematics.J_com @ command, wanted, atol=2e-3)
    integral = standing.state.angular_momentum * DT
    np.testing.assert_allclose(
        kinematics.J_momentum @ command, -config.momentum * integral, atol=2e-2
    )
    assert np.abs(kinematics.J_feet @ command).max() <= 1e-8


@given(seeds, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.sampled_from(["daqp", "osqp"]))
def test_limits_hold_whatever_is_asked(seed, forward, upward, solver):
    standing, config = Standing(seed), VelocityConfig(solver=solver)
    subject = controller(standing, solver=solver)
    command = tick(subject, standing, np.array([forward, 0.0, upward]))
    assert (np.abs(command) <= config.velocity_margin * ROBOT.velocity_limit).all()
    assert config.limit_horizon >= DT
    reached = standing.state.joint_position + command * config.limit_horizon
    assert (reached >= ROBOT.lower_position - 1e-12).all()
    assert (reached <= ROBOT.upper_position + 1e-12).all()
    if not subject.report.failed:
        tolerance = {"daqp": 1e-8, "osqp": 1e-6}[solver]
        assert np.abs(standing.kinematics.J_feet @ command).max() <= tolerance


def test_degrades_in_the_stated_order():
    """At the speed limits momentum gives way first; taking it away does not help the CoM."""
    standing = Standing(0)
    asked = np.array([0.0, 0.0, 3.0])
    J_com, J_momentum = standing.kinematics.J_com, standing.kinematics.J_momentum

    def errors(momentum_control):
        subject = controller(standing, momentum_control=momentum_control)
        command = tick(subject, standing, asked)
        assert not subject.report.failed
        return np.linalg.norm(J_com @ command - asked), np.linalg.norm(J_momentum @ command)

    com_error, momentum = errors(True)
    best_com_error, _ = errors(False)
    assert momentum > 0.01
    assert com_error == pytest.approx(best_com_error, rel=0.02)
    assert best_com_error > 0.5


@given(seeds, com_velocities)
def test_solvers_give_the_same_commands(seed, com_velocity):
    standing = Standing(seed)
    daqp, osqp = (
        tick(controller(standing, solver=name), standing, 4 * com_velocity)
        for name in ("daqp", "osqp")
    )
    np.testing.assert_allclose(daqp, osqp, atol=1e-3)


def test_smoothness_pulls_towards_the_previous_command():
    standing = Standing(0)
    steps = []
    for weight in (0.1, 10.0):
        subject = controller(standing, smoothness_weight=(weight,) * 3)
        commands = [tick(subject, standing, [0.0, 0.0, speed]) for speed in (0.0, 0.3)]
        steps.append(np.linalg.norm(commands[1] - commands[0]))
    assert steps[1] < steps[0]


def test_per_joint_weights_favour_joints():
    standing, uses = Standing(0), []
    knees = [ROBOT.joint_names.index(f"{side}_knee") for side in "lr"]
    for weight in (1.0, 100.0):
        weights = np.ones(N)
        weights[knees] = weight
        subject = controller(standing, posture_weight=weights)
        uses.append(abs(tick(subject, standing, [0.0, 0.0, 0.2])[knees[0]]))
    assert uses[1] < uses[0]


@pytest.mark.parametrize("field", ["posture_weight", "smoothness_weight"])
def test_a_wrong_number_of_weights_is_refused(field):
    with pytest.raises(ConfigError, match=r"3 weights .* or 23") as refusal:
        controller(Standing(0), **{field: (1.0,) * 22})
    assert refusal.value.field == field


def script(subject, *answers):
    """Put words into the mouth of the controller's solver, which has all the QPs."""
    checked = subject.qp._solver
    checked._closed = None
    checked._solver = Scripted(checked._solver, answers)


class Scripted:
    """A solver that says what the test wants."""

    def __init__(self, real, script):
        self._real, self._script = real, iter(script)
        self.tolerances = real.tolerances

    def solve(self):
        return next(self._script)(self._real.solve())


def honest(solution):
    return solution


def failing(status):
    return lambda solution: solution._replace(x=1e9 * np.ones_like(solution.x), status=status)


def lying(solution):
    return solution._replace(x=solution.x + 0.1)


def gone(solution):
    return QPSolution(np.full_like(solution.x, np.nan), solution.multipliers, QPStatus.SOLVED, 1)


@pytest.mark.parametrize(
    ("failure", "status"),
    [
        (failing(QPStatus.INFEASIBLE), QPStatus.INFEASIBLE),
        (failing(QPStatus.SOLVER_ERROR), QPStatus.SOLVER_ERROR),
        (lying, QPStatus.REJECTED),
        (gone, QPStatus.REJECTED),
    ],
)
def test_a_failed_solve_keeps_the_previous_command(failure, status):
    standing = Standing(0)
    subject = controller(standing)
    script(subject, honest, failure, honest)
    velocity = np.array([0.0, 0.0, 0.2])
    first, second, third = (tick(subject, standing, velocity * k) for k in (1, 2, 3))
    np.testing.assert_array_equal(second, first)
    assert np.abs(third - first).max() > 0.01
    assert subject.report.status is QPStatus.SOLVED


@pytest.mark.parametrize("failure", [failing(QPStatus.INFEASIBLE), lying, gone])
def test_a_failed_solve_is_reported(failure):
    standing = Standing(0)
    subject = controller(standing)
    script(subject, failure)
    command = tick(subject, standing)
    assert subject.report.failed
    assert not command.any()


@pytest.mark.parametrize("constraints", ["soft", "hard"])
def test_feet_and_limits_that_contradict_each_other_are_a_counted_failure(constraints):
    """One leg beyond its lower limits and the other beyond its upper ones: no way back
    with both feet at rest."""
    standing = Standing(0)
    s = standing.state.joint_position.copy()
    s[ROBOT.left_leg] = ROBOT.lower_position[ROBOT.left_leg] - 0.02
    s[ROBOT.right_leg] = ROBOT.upper_position[ROBOT.right_leg] + 0.02
    standing.be(s)
    subject = controller(standing, constraints=constraints)
    command = tick(subject, standing)
    assert subject.report.status is QPStatus.INFEASIBLE
    # The limits still hold: every joint is on its way back into its range.
    horizon = VelocityConfig().limit_horizon
    assert (command[ROBOT.left_leg] >= 0.02 / horizon - 1e-9).all()
    assert (command[ROBOT.right_leg] <= -0.02 / horizon + 1e-9).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("com", -1.0), ("momentum", np.nan), ("frequency", 0.0), ("constraints", "firm"),
        ("posture_weight", (0.0,) * 23), ("smoothness_weight", 1.0), ("com_weight", "big"),
        ("phases", None), ("kind", "torque"), ("velocity_margin", 1.5), ("limit_horizon", -0.1),
    ],
)  # fmt: skip
def test_bad_gains_are_refused(field, value):
    with pytest.raises(ConfigError) as refusal:
        dataclasses.replace(VelocityConfig(), **{field: value})
    assert refusal.value.field == field


def test_reset_makes_a_controller_as_new():
    standing = Standing(0)
    used, fresh = controller(standing), controller(standing)
    for seed in range(5):
        standing.move(seed)
        tick(used, standing, [0.0, 0.0, 0.3])
    used.reset(STANCE)
    for seed in range(3):
        standing.move(seed)
        commands = [tick(subject, standing, [0.0, 0.0, 0.2]) for subject in (used, fresh)]
        np.testing.assert_array_equal(*commands)


def test_momentum_integral_is_the_sum_of_the_measured_momentum():
    """Eq. 3d: the target follows -K times the integral, tick by tick."""
    standing = Standing(1)
    subject = controller(standing)
    H = standing.state.angular_momentum.copy()
    for count in range(1, 6):
        achieved = standing.kinematics.J_momentum @ tick(subject, standing)
        expected = -VelocityConfig().momentum * count * DT * H
        np.testing.assert_allclose(achieved, expected, atol=2e-2)


class TestHardConstraints:
    """Eq. 3 as printed."""

    @given(seeds, com_velocities)
    def test_com_and_momentum_hold_where_they_can(self, seed, com_velocity):
        standing, config = Standing(seed), VelocityConfig()
        subject = controller(standing, constraints="hard")
        standing.ask(size=0.5)
        command, kinematics = tick(subject, standing, com_velocity), standing.kinematics
        assert subject.report.status is QPStatus.SOLVED
        state, wanted = standing.state, standing.setpoint
        com = com_velocity - config.com * (state.com - wanted.com_position)
        np.testing.assert_allclose(kinematics.J_com @ command, com, atol=1e-6)
        integral = (state.angular_momentum - wanted.angular_momentum) * DT
        momentum = wanted.angular_momentum - config.momentum * integral
        np.testing.assert_allclose(kinematics.J_momentum @ command, momentum, atol=1e-6)

    @pytest.mark.parametrize("solver", ["daqp", "osqp"])
    def test_an_impossible_tick_is_a_failure_answered_by_the_soft_qp(self, solver):
        """Bit for bit, and the tick after it goes on from there."""
        standing = Standing(3)
        hard, soft = (
            controller(standing, constraints=constraints, solver=solver)
            for constraints in ("hard", "soft")
        )
        answers = [tick(subject, standing, [0.0, 0.0, 5.0]) for subject in (hard, soft)]
        assert hard.report.failed
        assert not soft.report.failed
        np.testing.assert_array_equal(*answers)
        assert np.abs(answers[0]).max() > 1.0
        if solver == "daqp":
            assert hard.report.status is QPStatus.INFEASIBLE
        tick(hard, standing, [0.0, 0.0, 0.1])
        assert not hard.report.failed

    def test_without_momentum_control_only_the_com_is_hard(self):
        standing = Standing(4)
        with_, without = (
            controller(standing, constraints="hard", momentum_control=on) for on in (True, False)
        )
        assert with_.qp.problem.n_equalities == 12
        assert without.qp.problem.n_equalities == 9
        standing.setpoint.angular_momentum[:] = [0.0, 2.0, 0.0]
        momenta = [standing.kinematics.J_momentum @ tick(s, standing)[:] for s in (with_, without)]
        assert momenta[0][1] == pytest.approx(2.0, abs=0.2)
        assert abs(momenta[1][1]) < 0.5
