"""Whole-body plans: families, their files, and what follows from the joint trajectories."""

import copy
import dataclasses
import json
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ConfigError, HeightNotReachableError, PlanFileError
from icub_jump_env.planning.whole_body.family import (
    SHIPPED,
    WholeBodyPlanner,
    family_of,
    load_family,
)
from icub_jump_env.planning.whole_body.plan import JointKnots, WholeBodyPlan
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()
FAMILIES = {name: family_of(ROBOT, name) for name in ("velocity", "torque")}
ZERO = np.zeros(3, dtype=np.float32)
RATES = ("velocity", "acceleration")
STATES = ("position", *RATES)


def plan_of(name, height):
    return WholeBodyPlanner(FAMILIES[name], FeetFixedKinematics(ROBOT)).plan(height)


def copies(setpoint):
    return {name: setpoint.block[name][0].copy() for name in setpoint.block.dtype.names}


commands = st.tuples(st.sampled_from(sorted(FAMILIES)), st.floats(0.02, 0.07), st.floats(0.0, 1.0))


@given(commands)
def test_rates_are_derivatives(command):
    name, height, share = command
    plan, h = plan_of(name, height), 1e-6
    time = h + share * (plan.duration - 2 * h)
    before, here, after = (copies(plan.sample(time + late)) for late in (-h, 0.0, h))
    for value, rate, tolerance in (
        ("com_position", "com_velocity", 1e-6),
        ("com_velocity", "com_acceleration", 1e-2),
        ("angular_momentum", "angular_momentum_rate", 1e-2),
        ("posture", "posture_velocity", 1e-5),
        ("posture_velocity", "posture_acceleration", 1e-1),
    ):
        difference = (after[value] - before[value]) / (2 * h)
        np.testing.assert_allclose(here[rate], difference, rtol=1e-4, atol=tolerance)


@given(commands)
def test_com_and_momentum_are_those_of_the_joints(command):
    """At the knots exactly, between them to a tenth of a millimetre."""
    name, height, share = command
    plan, kinematics = plan_of(name, height), FeetFixedKinematics(ROBOT)
    kinematics.update(plan.stance.posture)
    start = kinematics.com.copy()
    knot = round(share * 24) / 24
    for time, tolerance in ((knot * plan.duration, 1e-9), (share * plan.duration, 1e-4)):
        wanted = plan.sample(time)
        kinematics.update(wanted.posture)
        com = kinematics.com - start
        np.testing.assert_allclose(wanted.com_position, com, atol=tolerance)
        velocity = kinematics.J_com @ wanted.posture_velocity
        np.testing.assert_allclose(wanted.com_velocity, velocity, atol=20 * tolerance)
        momentum = kinematics.J_momentum @ wanted.posture_velocity
        np.testing.assert_allclose(wanted.angular_momentum, momentum, atol=100 * tolerance)


@given(commands)
def test_a_plan_keeps_the_robots_limits(command):
    name, height, share = command
    plan = plan_of(name, height)
    wanted = plan.sample(share * plan.duration)
    assert (wanted.posture > ROBOT.lower_position).all()
    assert (wanted.posture < ROBOT.upper_position).all()
    assert (np.abs(wanted.posture_velocity) < ROBOT.velocity_limit).all()
    assert wanted.com_acceleration[2] > -0.75 * GRAVITY
    assert (plan.landing_posture > ROBOT.lower_position).all()
    assert (plan.landing_posture < ROBOT.upper_position).all()
    assert (np.abs(plan.stance.torque) < ROBOT.effort_limit).all()


@pytest.mark.parametrize("name", FAMILIES)
def test_a_plan_starts_at_rest_and_ends_as_fast_as_the_jump_needs(name):
    family, kinematics = FAMILIES[name], FeetFixedKinematics(ROBOT)
    for member, planned in enumerate(family.card["plans"]):
        knots = JointKnots(
            float(family.duration[member]), family.position[member],
            family.velocity[member], family.acceleration[member],
        )  # fmt: skip
        plan = WholeBodyPlan(knots, family.landing[member], 0.14, kinematics)
        start = copies(plan.sample(0.0))
        for rate in ("com_velocity", "posture_velocity", "angular_momentum"):
            np.testing.assert_allclose(start[rate], 0.0, atol=1e-9)
        end = copies(plan.sample(plan.duration))
        assert plan.displacement == pytest.approx(end["com_position"][2])
        rise = end["com_velocity"][2] ** 2 / (2 * GRAVITY)
        assert rise == pytest.approx(planned["height"], abs=1e-6)


def test_a_plan_is_left_right_symmetric():
    wanted = plan_of("torque", 0.05).sample(0.3)
    left, right = ROBOT.left_leg, ROBOT.right_leg
    np.testing.assert_allclose(wanted.posture[left], wanted.posture[right])
    np.testing.assert_allclose(wanted.com_velocity[1], 0.0, atol=1e-3)


@pytest.mark.parametrize("name", FAMILIES)
def test_commands_beyond_the_family_are_refused_with_what_binds(name):
    family = FAMILIES[name]
    JumpConfig(controller=name, planner="whole_body", jump_height=family.highest)
    with pytest.raises(HeightNotReachableError, match="knee speed") as error:
        JumpConfig(controller=name, planner="whole_body", jump_height=family.highest + 1e-3)
    assert error.value.field == "jump_height"
    with pytest.raises(HeightNotReachableError, match="at least"):
        JumpConfig(controller=name, planner="whole_body", jump_height=family.lowest - 1e-3)
    JumpConfig(controller=name, jump_height=family.highest + 1e-3)


@pytest.mark.parametrize(
    ("field", "value"),
    [("com_displacement", 0.1), ("com_scaling", "acceleration"), ("launch_end", "lift_off"),
     ("ankle_shift", False)],
)  # fmt: skip
def test_what_only_a_scaled_curve_has_is_refused(field, value):
    with pytest.raises(ConfigError, match="planner='whole_body'") as error:
        JumpConfig.of(planner="whole_body", **{field: value})
    assert error.value.field == field
    with pytest.raises(ConfigError, match="planner='scaled_curve'"):
        JumpConfig(plans="plans.npz")


def test_no_plans_of_another_robot():
    with pytest.raises(PlanFileError, match=r"icub_jump_env\.planning makes one"):
        JumpConfig(robot="iCubGenova02", planner="whole_body")
    with pytest.raises(PlanFileError, match="controller is 'torque' instead of 'velocity'"):
        JumpConfig(planner="whole_body", plans=str(SHIPPED / "iCubGenova04-torque.npz"))


class TestFiles:
    def test_a_family_survives_its_files_byte_for_byte(self, tmp_path):
        family = FAMILIES["velocity"]
        for name in ("one.npz", "two.npz"):
            family.save(tmp_path / name)
        assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
        again = load_family(tmp_path / "one.json")
        np.testing.assert_array_equal(again.position, family.position)
        assert again.card == family.card

    @pytest.mark.parametrize(
        ("damage", "match"),
        [
            (lambda path: path.unlink(), "no such file"),
            (lambda path: path.write_bytes(path.read_bytes()[:-9] + b"123456789"), "damaged"),
            (lambda path: path.with_suffix(".json").write_text("{"), "not readable as JSON"),
        ],
    )
    def test_damaged_files_are_told(self, tmp_path, damage, match):
        path = tmp_path / "family.npz"
        FAMILIES["velocity"].save(path)
        damage(path)
        with pytest.raises(PlanFileError, match=match):
            load_family(path)

    @pytest.mark.parametrize(
        ("change", "match"),
        [
            (lambda f: {"duration": np.full_like(f.duration, np.nan)}, "duration is not finite"),
            (lambda f: {"duration": -f.duration}, "not positive"),
            (lambda f: {"retraction": 0 * f.retraction}, "not positive"),
            (lambda f: {"rise": f.rise[::-1]}, "ascending"),
            (lambda f: {"branch": np.arange(len(f.rise))}, "two plans or more"),
            (lambda f: {"rise": f.rise[None]}, "rise has the shape"),
            (lambda f: {"rise": f.rise.astype(object)}, "not a family of plans"),  # a pickle
            (lambda f: {"velocity": f.velocity[:, 1:]}, "different shapes"),
            (lambda f: {"acceleration": f.acceleration[:, 1:]}, "different shapes"),
            (lambda f: {"position": f.position[:, 1:]}, "different shapes"),
            (lambda f: {name: getattr(f, name)[:, 1:] for name in RATES}, "different shapes"),
            (lambda f: {name: getattr(f, name)[:, :1] for name in STATES}, "different shapes"),
            (lambda f: {"landing": f.landing[:, 1:]}, "other joints"),
            (lambda f: {"card": {**f.card, "format": 0}}, "its card is not of format 1"),
            (lambda f: {"card": {**f.card, "optimum": None}}, "what binds"),
            (lambda f: {"card": {**f.card, "optimum": {"binding": {"knee": [0]}}}}, "what binds"),
            (lambda f: {"card": {**f.card, "optimum": {"binding": {}}}}, "how high"),
            (lambda f: {"card": {**f.card, "plans": []}}, "a card of other plans"),
            (lambda f: {"card": {**f.card, "plans": [{}] * len(f.rise)}}, "what binds"),
        ],
    )
    def test_what_cannot_be_followed_is_told(self, tmp_path, change, match):
        path, family = tmp_path / "family.npz", FAMILIES["velocity"]
        dataclasses.replace(family, **change(family)).save(path)
        with pytest.raises(PlanFileError, match=match):
            load_family(path)

    def test_a_file_written_anew_is_read_anew(self, tmp_path):
        path, family = tmp_path / "family.npz", FAMILIES["velocity"]
        family.save(path)
        config = JumpConfig(planner="whole_body", plans=str(path))
        dataclasses.replace(family, rise=family.rise - 1e-3).save(path)
        assert config.plan_family.highest == pytest.approx(family.highest - 1e-3)

    def test_a_card_says_how_its_plans_were_made(self):
        card = json.loads((SHIPPED / "iCubGenova04-velocity.json").read_text())
        assert card["robot"] == "iCubGenova04"
        assert card["versions"].keys() == {"casadi", "numpy", "pin"}
        assert all(plan["violation"] < 1e-5 for plan in card["plans"])
        assert card["margins"]["branches"][0]["launch"]["torque"] == 0.85


@pytest.mark.parametrize("name", FAMILIES)
def test_a_command_nobody_tuned_is_jumped(name):
    """The set point reaches the controller; the same command again, the same bits."""
    env = ICubJumpEnv(controller=name, planner="whole_body", jump_height=0.0437, stand_time=0.5)
    jumps = []
    for _ in range(2):
        env.reset(seed=0)
        terminated = False
        while not terminated:
            *_, terminated, _, info = env.step(ZERO)
        jumps.append(info["jump"])
    assert jumps[0] == jumps[1]
    assert info["outcome"] == "stood"
    assert info["jump"]["flight_height"] == pytest.approx(0.0437, abs=0.003)
    assert info["jump"]["limit_violations"] == 0


@pytest.mark.parametrize("copier", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("name", FAMILIES)
def test_a_copy_goes_on_bit_for_bit(name, copier):
    env = ICubJumpEnv(controller=name, planner="whole_body", jump_height=0.05)
    env.reset(seed=0)
    for _ in range(20):
        env.step(ZERO)
    twin = copier(env)
    for _ in range(40):
        (ours, *_), (theirs, *_) = env.step(ZERO), twin.step(ZERO)
        np.testing.assert_array_equal(ours, theirs)


def test_a_residual_moves_the_set_point_of_a_plan():
    """By the filtered offset; the plan itself stays."""
    env = ICubJumpEnv(planner="whole_body", jump_height=0.05)
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.ones(3))
    controller, data = env._controller, env.data
    controller.reference.update(controller.jump_time(data.time))
    moved = controller.reference.setpoint.com_position.copy()
    planned = controller.plan.sample(controller.jump_time(data.time)).com_position
    offset = controller.residual.offset[:3]
    assert offset.min() > 0.005
    np.testing.assert_allclose(moved - env._start_com - planned, offset, atol=1e-9)


def test_another_command_is_another_plan():
    planner = WholeBodyPlanner(FAMILIES["velocity"], FeetFixedKinematics(ROBOT))
    plan = planner.plan(0.04)
    assert planner.plan(0.04) is plan
    higher = planner.plan(0.05)
    assert higher is not plan
    first = planner.plan(0.04).sample(0.2).posture
    np.testing.assert_array_equal(first, plan_of("velocity", 0.04).sample(0.2).posture)


def test_joints_follow_the_cubic_between_the_knots():
    rng = np.random.default_rng(0)
    T, jerk = 0.4, rng.normal(size=ROBOT.n_joints)
    time = np.linspace(0.0, T, 5)[:, None]
    rest = ROBOT.crouch
    knots = JointKnots(T, rest + jerk * time**3 / 6, jerk * time**2 / 2, jerk * time)
    plan = WholeBodyPlan(knots, ROBOT.landing, 0.1, FeetFixedKinematics(ROBOT))
    for t in rng.uniform(0.0, T, size=10):
        wanted = plan.sample(t)
        np.testing.assert_allclose(wanted.posture, rest + jerk * t**3 / 6, atol=1e-12)
        np.testing.assert_allclose(wanted.posture_velocity, jerk * t**2 / 2, atol=1e-11)
        np.testing.assert_allclose(wanted.posture_acceleration, jerk * t, atol=1e-9)
