"""Eq. 3: against the textbook form, at the limits, and when the solver fails."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.qp.problem import QPSolution, QPStatus
from icub_jump_env.control.velocity import VelocityController, VelocityGains
from icub_jump_env.errors import ConfigError
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()

DT = 0.005
model = build_pinocchio_model(ROBOT)
LIMITS = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
com_velocities = st.tuples(
    st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(0.0, 0.3)
).map(np.array)
seeds = st.integers(0, 1000)


def controller(**options):
    return VelocityController(ROBOT.crouch, LIMITS, DT, **options)


def tick(subject, estimator, s, com_position, com_velocity):
    """The joint velocities that the controller commands for a CoM reference."""
    reference = SimpleNamespace(position=com_position, velocity=com_velocity)
    return subject.command(estimator, s, None, reference).velocity


def measured(seed, spread=0.02):
    """An estimator at a random posture that keeps both feet on the floor, and the readings."""
    rng = np.random.default_rng(seed)
    s = ROBOT.crouch + 0.0
    stance = rng.normal(scale=spread, size=6)
    s[ROBOT.left_leg] += stance * [1, 0, 0, 1, 1, 0]
    s[ROBOT.right_leg] += stance * [1, 0, 0, 1, 1, 0]
    s[ROBOT.torso] += rng.normal(scale=spread, size=3)
    s[ROBOT.arms] += rng.normal(scale=spread, size=8)
    s = np.clip(s, LIMITS[0] + 0.05, LIMITS[1] - 0.05)
    s_dot = 0.1 * rng.normal(size=ROBOT.n_joints)
    estimator = FeetFixedEstimator(FeetFixedKinematics(ROBOT))
    estimator.update(s, s_dot)
    return estimator, s


def textbook(
    estimator, s, com_velocity, previous, momentum_integral, gains, momentum_control=True
):
    """Eq. 3 in nu = (base, joints), from Pinocchio alone, its optimality system solved exactly.

    Valid where no limit is active. The CoM and momentum rows carry the controller's
    weights; the feet are hard.
    """
    kinematics = estimator.kinematics
    quaternion = pin.Quaternion(kinematics.base_rotation).coeffs()
    q = np.concatenate((kinematics.base_position, quaternion, s))
    data = model.createData()
    feet = np.vstack(
        [pin.computeFrameJacobian(model, data, q, model.getFrameId(f)) for f in ROBOT.sole_frames]
    )
    pin.computeCentroidalMap(model, data, q)
    rows = [data.Ag[:3] / kinematics.mass]
    targets = [com_velocity]
    weights = [gains.com_weight]
    if momentum_control:
        rows.append(data.Ag[3:].copy())
        targets.append(-gains.momentum * momentum_integral)
        weights.append(gains.momentum_weight)
    Lambda, Delta = np.array(gains.posture_weight), np.array(gains.smoothness_weight)
    H = np.zeros((29, 29))
    H[6:, 6:] = np.diag(Lambda + Delta)
    g = np.zeros(29)
    g[6:] = -(Lambda * -gains.posture * (s - ROBOT.crouch) + Delta * previous)
    for row, target, weight in zip(rows, targets, weights, strict=True):
        H += weight * row.T @ row
        g -= weight * row.T @ target
    kkt = np.block([[H, feet.T], [feet, np.zeros((12, 12))]])
    # A second solve against the residual makes up for the spread of the weights.
    right = np.concatenate((-g, np.zeros(12)))
    solution = np.linalg.solve(kkt, right)
    solution += np.linalg.solve(kkt, right - kkt @ solution)
    return solution[:29], rows


@given(seeds, com_velocities, st.booleans())
def test_equals_the_textbook_form_where_no_limit_is_active(seed, com_velocity, momentum_control):
    estimator, s = measured(seed)
    gains = VelocityGains()
    subject = controller(momentum_control=momentum_control)
    command = tick(subject, estimator, s, estimator.com, com_velocity)
    integral = estimator.angular_momentum * DT
    nu, _ = textbook(
        estimator, s, com_velocity, np.zeros(ROBOT.n_joints), integral, gains, momentum_control
    )
    assert (np.abs(nu[6:]) < 0.9 * ROBOT.velocity_limit).all()
    np.testing.assert_allclose(command, nu[6:], atol=1e-7)


def test_momentum_control_off_removes_the_momentum_rows_and_nothing_else():
    """With a momentum weight of zero the full problem is the reduced one."""
    estimator, s = measured(7)
    velocity = np.array([0.0, 0.0, 0.2])
    without = controller(momentum_control=False)
    weightless = controller(gains=dataclasses.replace(VelocityGains(), momentum_weight=0.0))
    np.testing.assert_allclose(
        tick(without, estimator, s, estimator.com, velocity),
        tick(weightless, estimator, s, estimator.com, velocity),
        atol=1e-12,
    )
    for field in ("lower", "upper", "C"):
        np.testing.assert_array_equal(
            getattr(without.problem, field), getattr(weightless.problem, field)
        )


@given(seeds, com_velocities)
def test_tasks_hold_where_no_limit_is_active(seed, com_velocity):
    estimator, s = measured(seed)
    subject = controller()
    gains = VelocityGains()
    position = estimator.com + [0.001, 0.0, 0.002]
    command = tick(subject, estimator, s, position, com_velocity)
    kinematics = estimator.kinematics
    wanted = com_velocity + gains.com * (position - estimator.com)
    np.testing.assert_allclose(kinematics.J_com @ command, wanted, atol=2e-3)
    integral = estimator.angular_momentum * DT
    np.testing.assert_allclose(
        kinematics.J_momentum @ command, -gains.momentum * integral, atol=2e-2
    )
    assert np.abs(kinematics.J_feet @ command).max() <= 1e-8


@given(seeds, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.sampled_from(["daqp", "osqp"]))
def test_limits_hold_whatever_is_asked(seed, forward, upward, solver):
    estimator, s = measured(seed)
    subject = controller(solver=solver)
    command = tick(subject, estimator, s, estimator.com, np.array([forward, 0.0, upward]))
    assert (np.abs(command) <= VelocityGains().velocity_margin * ROBOT.velocity_limit).all()
    horizon = VelocityGains().limit_horizon
    assert horizon >= DT
    assert (s + command * horizon >= LIMITS[0] - 1e-12).all()
    assert (s + command * horizon <= LIMITS[1] + 1e-12).all()
    if not subject.report.failed:
        tolerance = {"daqp": 1e-8, "osqp": 1e-6}[solver]
        assert np.abs(estimator.kinematics.J_feet @ command).max() <= tolerance


def test_degrades_in_the_stated_order():
    """At the speed limits momentum gives way first; taking it away does not help the CoM."""
    estimator, s = measured(0)
    asked = np.array([0.0, 0.0, 3.0])
    J_com, J_momentum = estimator.kinematics.J_com, estimator.kinematics.J_momentum

    def errors(momentum_control):
        subject = controller(momentum_control=momentum_control)
        command = tick(subject, estimator, s, estimator.com, asked)
        assert not subject.report.failed
        return np.linalg.norm(J_com @ command - asked), np.linalg.norm(J_momentum @ command)

    com_error, momentum = errors(True)
    best_com_error, _ = errors(False)
    assert momentum > 0.01
    assert com_error == pytest.approx(best_com_error, rel=0.02)
    assert best_com_error > 0.5


@given(seeds, com_velocities)
def test_solvers_give_the_same_commands(seed, com_velocity):
    estimator, s = measured(seed)
    daqp, osqp = (
        tick(controller(solver=name), estimator, s, estimator.com, 4 * com_velocity)
        for name in ("daqp", "osqp")
    )
    np.testing.assert_allclose(daqp, osqp, atol=1e-3)


def test_smoothness_pulls_towards_the_previous_command():
    estimator, s = measured(0)
    steps = []
    for weight in (0.1, 10.0):
        gains = dataclasses.replace(VelocityGains(), smoothness_weight=(weight,) * ROBOT.n_joints)
        subject = controller(gains=gains)
        commands = [
            tick(subject, estimator, s, estimator.com, np.array([0.0, 0.0, speed]))
            for speed in (0.0, 0.3)
        ]
        steps.append(np.linalg.norm(commands[1] - commands[0]))
    assert steps[1] < steps[0]


def test_per_joint_weights_favour_joints():
    estimator, s = measured(0)
    knee = ROBOT.joint_names.index("l_knee")
    uses = []
    for weight in (1.0, 100.0):
        weights = np.ones(ROBOT.n_joints)
        weights[[knee, ROBOT.joint_names.index("r_knee")]] = weight
        gains = dataclasses.replace(VelocityGains(), posture_weight=tuple(weights))
        command = tick(
            controller(gains=gains), estimator, s, estimator.com, np.array([0.0, 0.0, 0.2])
        )
        uses.append(abs(command[knee]))
    assert uses[1] < uses[0]


def script(subject, *answers):
    """Put words into the mouth of the controller's solver."""
    checked = subject._solver
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
    estimator, s = measured(0)
    subject = controller()
    script(subject, honest, failure, honest)
    velocity = np.array([0.0, 0.0, 0.2])
    first, second, third = (
        tick(subject, estimator, s, estimator.com, velocity * k) for k in (1, 2, 3)
    )
    np.testing.assert_array_equal(second, first)
    assert np.abs(third - first).max() > 0.01
    assert subject.report.status is QPStatus.SOLVED


@pytest.mark.parametrize("failure", [failing(QPStatus.INFEASIBLE), lying, gone])
def test_a_failed_solve_is_reported(failure):
    estimator, s = measured(0)
    subject = controller()
    script(subject, failure)
    command = tick(subject, estimator, s, estimator.com, np.zeros(3))
    assert subject.report.failed
    assert not command.any()


def test_feet_and_limits_that_contradict_each_other_are_a_counted_failure():
    """One leg beyond its lower limits and the other beyond its upper ones: no way back
    with both feet at rest."""
    estimator, s = measured(0)
    s = s.copy()
    s[ROBOT.left_leg] = LIMITS[0][ROBOT.left_leg] - 0.02
    s[ROBOT.right_leg] = LIMITS[1][ROBOT.right_leg] + 0.02
    estimator.update(s, np.zeros(ROBOT.n_joints))
    subject = controller()
    command = tick(subject, estimator, s, estimator.com, np.zeros(3))
    assert subject.report.status is QPStatus.INFEASIBLE
    # The limits still hold: every joint is on its way back into its range.
    horizon = VelocityGains().limit_horizon
    assert (command[ROBOT.left_leg] >= 0.02 / horizon - 1e-9).all()
    assert (command[ROBOT.right_leg] <= -0.02 / horizon + 1e-9).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("com", -1.0), ("momentum", np.nan), ("posture_weight", (1.0,) * 22),
        ("posture_weight", (0.0,) * 23), ("smoothness_weight", 1.0), ("com_weight", "big"),
        ("velocity_margin", 1.5), ("limit_horizon", -0.1),
    ],
)  # fmt: skip
def test_bad_gains_are_refused(field, value):
    with pytest.raises(ConfigError) as refusal:
        dataclasses.replace(VelocityGains(), **{field: value})
    assert refusal.value.field == field


def test_reset_makes_a_controller_as_new():
    used, fresh = controller(), controller()
    for seed in range(5):
        estimator, s = measured(seed)
        tick(used, estimator, s, estimator.com, np.array([0.0, 0.0, 0.3]))
    used.reset()
    for seed in range(3):
        estimator, s = measured(seed)
        arguments = estimator, s, estimator.com, np.array([0.0, 0.0, 0.2])
        np.testing.assert_array_equal(tick(used, *arguments), tick(fresh, *arguments))


def test_momentum_integral_is_the_sum_of_the_measured_momentum():
    """Eq. 3d: the target follows -K times the integral, tick by tick."""
    subject = controller()
    estimator, s = measured(1)
    H = estimator.angular_momentum.copy()
    gains = VelocityGains()
    for count in range(1, 6):
        command = tick(subject, estimator, s, estimator.com, np.zeros(3))
        achieved = estimator.kinematics.J_momentum @ command
        np.testing.assert_allclose(achieved, -gains.momentum * count * DT * H, atol=2e-2)
