"""Making whole-body plans: the sagittal model, the program, and what the shipped plans keep."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from experiments.collision_shapes import hulls
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, PlanningError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.files import strict_json
from icub_jump_env.planning.whole_body.family import family_of
from icub_jump_env.planning.whole_body.margins import MARGINS, LandingMargins, LaunchMargins
from icub_jump_env.robot.dynamics import FeetFixedDynamics
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.urdf import model_path

pytest.importorskip("casadi")

from icub_jump_env.planning.whole_body import build
from icub_jump_env.planning.whole_body.binding import binding
from icub_jump_env.planning.whole_body.landing import LandingProgram
from icub_jump_env.planning.whole_body.launch import (
    HIP,
    Launch,
    LaunchProgram,
    largest_speeds,
    largest_torques,
)
from icub_jump_env.planning.whole_body.sagittal import (
    COORDINATES,
    SagittalModel,
    chest_pitch,
    coordinates,
    selection,
)

ROBOT = load_robot()
FAMILIES = {name: family_of(ROBOT, name) for name in MARGINS}
FAMILY = FAMILIES["velocity"]
MEMBERS = [
    (name, member) for name, family in FAMILIES.items() for member in range(len(family.rise))
]


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        (LaunchMargins, {"torque": 1.01}, "torque=1.01 .* 0.05 to 1 of the limit"),
        (LaunchMargins, {"duration": (0.5, 0.2)}, "duration=.* the lower bound first"),
        (LaunchMargins, {"friction": "rubber"}, "friction='rubber'"),
        (LandingMargins, {"chest": 0.1}, "chest=0.1 .* 2 numbers .* rad"),
        (LandingMargins, {"posture": (1.0, 2.0)}, "posture=.* 6 numbers"),
    ],
)
def test_margins_are_validated(kind, changes, message):
    with pytest.raises(ConfigError, match=message):
        kind(**changes)


@pytest.fixture(scope="module")
def model():
    return SagittalModel(ROBOT, MARGINS["velocity"].shoulder_roll)


def values(model, q, v, a):
    outputs = model.dynamics(q, v, a)
    return {
        name: np.array(value).ravel()
        for name, value in zip(model.dynamics.name_out(), outputs, strict=True)
    }


def full(model, q, v, a):
    """Torques, ground force and moment, CoM, momentum of the robot with all its joints."""
    S = selection(ROBOT)
    s, s_dot, s_ddot = model.posture(q), S @ v, S @ a
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(s)
    dynamics = FeetFixedDynamics(kinematics)
    dynamics.update(s, s_dot)
    n = ROBOT.n_joints
    # Both feet carry the same: forces along x and z, moments about y.
    same = np.zeros((3, 12))
    for row, column in enumerate((0, 2, 4)):
        same[row, [column, column + 6]] = 1.0, -1.0
    wanted = dynamics.base_bias - dynamics.base_rows[:, :n] @ s_ddot
    f = np.linalg.lstsq(
        np.vstack((dynamics.base_rows[:, n:], same)), np.append(wanted, np.zeros(3)), rcond=None
    )[0]
    torque = dynamics.torque_rows @ np.concatenate((s_ddot, f)) + dynamics.torque_bias
    force, moment = f[:3] + f[6:9], f[4] + f[10]
    data = kinematics.model.createData()
    pin.framesForwardKinematics(kinematics.model, data, kinematics.configuration(s))
    for frame, (forward, _, up) in zip(ROBOT.sole_frames, (f[:3], f[6:9]), strict=True):
        x, _, z = data.oMf[kinematics.model.getFrameId(frame)].translation
        moment += z * forward - x * up
    momentum = (kinematics.J_momentum @ s_dot)[1]
    return torque, force, moment, kinematics.com, kinematics.J_com @ s_dot, momentum


@pytest.mark.parametrize("robot", ["iCubGenova04", "iCubGenova02", "iCubGazeboV2_7"])
def test_the_model_is_the_full_one(robot, rng, monkeypatch):
    monkeypatch.setitem(globals(), "ROBOT", load_robot(robot))
    model = SagittalModel(ROBOT, 0.5)
    left = [name for name in ROBOT.joint_names if not name.startswith("r_")]
    columns = [
        ROBOT.joint_names.index(next(j for j in left if j.removeprefix("l_") == coordinate))
        for coordinate in COORDINATES
    ]
    for _ in range(5):
        q = coordinates(ROBOT, ROBOT.crouch) + 0.2 * rng.normal(size=6)
        v, a = 3 * rng.normal(size=6), 30 * rng.normal(size=6)
        found = values(model, q, v, a)
        torque, force, moment, com, com_velocity, momentum = full(model, q, v, a)
        np.testing.assert_allclose(found["force"], force[[0, 2]], atol=1e-4)
        np.testing.assert_allclose(found["moment"], moment, atol=1e-3)
        np.testing.assert_allclose(found["com"], com[[0, 2]], atol=1e-9)
        np.testing.assert_allclose(found["com_velocity"], com_velocity[[0, 2]], atol=1e-9)
        np.testing.assert_allclose(found["momentum"], momentum, atol=1e-9)
        # What the inertias of left and right differ in loads their legs differently.
        np.testing.assert_allclose(found["torque"], torque[columns], atol=0.1)


def test_the_rate_of_the_momentum(model, rng):
    q = coordinates(ROBOT, ROBOT.crouch)
    v, a, h = rng.normal(size=6), 10 * rng.normal(size=6), 1e-6
    before, after = (
        values(model, q + sign * h * v + h**2 * a / 2, v + sign * h * a, a) for sign in (-1, 1)
    )
    rate = (after["momentum"] - before["momentum"]) / (2 * h)
    np.testing.assert_allclose(values(model, q, v, a)["momentum_rate"], rate, atol=1e-5)


def test_the_pitch_of_the_chest(model, rng):
    kinematics = FeetFixedKinematics(ROBOT)
    q = coordinates(ROBOT, ROBOT.crouch) + 0.1 * rng.normal(size=6)
    data = kinematics.model.createData()
    pin.framesForwardKinematics(kinematics.model, data, kinematics.configuration(model.posture(q)))
    chest = data.oMf[kinematics.model.getFrameId(ROBOT.chest_link)].rotation
    upright = data_of_upright(kinematics, model)
    pitch = pin.log3(chest @ upright.T)
    np.testing.assert_allclose(pitch, [0.0, chest_pitch(q[:, None])[0], 0.0], atol=1e-6)


def data_of_upright(kinematics, model):
    """Orientation of the chest where its pitch is zero."""
    data = kinematics.model.createData()
    q = kinematics.configuration(model.posture(np.zeros(6)))
    pin.framesForwardKinematics(kinematics.model, data, q)
    return data.oMf[kinematics.model.getFrameId(ROBOT.chest_link)].rotation.copy()


@pytest.mark.parametrize(("name", "member"), MEMBERS)
def test_shipped_plans_keep_their_margins(model, name, member):
    family = FAMILIES[name]
    margins = MARGINS[name].branches[family.branch[member]].launch
    speed = np.array(largest_speeds(ROBOT, margins))
    torque = np.array(largest_torques(ROBOT, margins))
    close = 1 + 1e-4
    sole = ROBOT.sole
    for s, s_dot, s_ddot in zip(
        family.position[member], family.velocity[member], family.acceleration[member], strict=True
    ):
        q, v, a = (coordinates(ROBOT, x) for x in (s, s_dot, s_ddot))
        found = values(model, q, v, a)
        assert (np.abs(v) <= speed * close).all()
        assert (np.abs(found["torque"]) <= torque * close).all()
        forward, up = found["force"]
        assert up >= (margins.least_load - 1e-4) * model.mass * GRAVITY
        assert abs(forward) <= margins.friction * up * close
        cop = -found["moment"][0] / up
        assert sole.x_min + margins.cop - 1e-4 <= cop <= sole.x_max - margins.cop + 1e-4
    assert found["com_velocity"][0] == pytest.approx(margins.forward_speed, abs=1e-4)
    assert margins.momentum[0] - 1e-4 <= found["momentum"][0] <= margins.momentum[1] + 1e-4


def test_a_search_finds_the_shipped_plan_again(model):
    branch = MARGINS["velocity"].branches[0]
    program = LaunchProgram(model, branch.launch)
    highest = program.highest(*branch.starts[0])
    assert highest.feasible
    assert highest.rise > branch.highest
    # As the family was made: from the top down, each search starting at the plan above.
    launch = highest
    for height in (0.06, 0.05):
        launch = program.to_height(height, launch, highest.q[0])
        assert launch.feasible
    assert launch.rise == pytest.approx(0.05, abs=1e-6)
    heights = [plan["height"] for plan in FAMILY.card["plans"]]
    np.testing.assert_allclose(
        model.posture(launch.q), FAMILY.position[heights.index(0.05)], atol=1e-4
    )


def test_a_search_finds_a_shipped_plan_again_whose_hips_close_as_far_as_they_may(model):
    margins = MARGINS["velocity"].branches
    program = LaunchProgram(model, margins[0].launch)
    program.keep(margins[1].launch)
    crouch = program.highest(*margins[1].starts[0]).q[0]
    member = list(FAMILY.branch).index(1)
    above = shipped_launch(model, "velocity", member + 1)
    launch = program.to_height(FAMILY.card["plans"][member]["height"], above, crouch)
    assert launch.q[-1, HIP] == pytest.approx(margins[1].launch.takeoff_hip, abs=1e-6)
    np.testing.assert_allclose(model.posture(launch.q), FAMILY.position[member], atol=1e-4)


@pytest.mark.parametrize("name", MARGINS)
def test_the_shipped_plans_were_made_with_these_margins(name):
    asked = json.loads(strict_json(dataclasses.asdict(MARGINS[name])))
    assert FAMILIES[name].card["margins"] == asked


def shipped_launch(model, name, member):
    """The launch of a shipped plan, with what the model says of it."""
    family = FAMILIES[name]
    columns = [family.position[member], family.velocity[member], family.acceleration[member]]
    q, v, a = (np.array([coordinates(ROBOT, x) for x in column]) for column in columns)
    knots = [values(model, *knot) for knot in zip(q, v, a, strict=True)]
    outputs = {key: np.array([knot[key] for knot in knots]) for key in knots[0]}
    plan = family.card["plans"][member]
    return Launch(family.duration[member], q, v, a, outputs, plan["height"], 0, 0.0)


@pytest.mark.parametrize(("name", "member"), MEMBERS)
def test_what_binds_is_found_again(model, name, member):
    margins = MARGINS[name].branches[FAMILIES[name].branch[member]].launch
    found = binding(model, shipped_launch(model, name, member), margins)
    told = FAMILIES[name].card["plans"][member]["binding"]
    assert {limit: list(times) for limit, times in found.items()} == told


@pytest.mark.parametrize(
    ("name", "member"), [MEMBERS[-1], MEMBERS[len(FAMILY.rise) - 1], MEMBERS[6]]
)
def test_the_landing_posture_is_found_again(model, name, member):
    family = FAMILIES[name]
    margins = MARGINS[name].branches[family.branch[member]].landing
    program = LandingProgram(model, margins)
    posture = program.solve(shipped_launch(model, name, member))
    np.testing.assert_allclose(model.posture(posture), family.landing[member], atol=1e-4)
    assert family.retraction[member] == margins.retraction


class Staircase:
    """A program that finds every launch up to a height."""

    def __init__(self, highest, infeasible=()):
        self.model = SimpleNamespace(robot=ROBOT)
        self.top, self.infeasible, self.asked = highest, infeasible, []

    def keep(self, margins):
        self.kept = margins

    def launch(self, rise):
        violation = 1.0 if rise in self.infeasible else 0.0
        return Launch(0.3, np.full((2, 6), rise), None, None, {}, rise, 0, violation)

    def highest(self, crouch, takeoff):
        return self.launch(self.top)

    def to_height(self, height, above, crouch):
        self.asked.append((height, above.rise, crouch[0]))
        return self.launch(height)


def test_a_branch_goes_from_its_highest_down_and_keeps_its_own():
    branch = MARGINS["velocity"].branches[0]
    program = Staircase(0.083)
    found = [launch.rise for launch in build._branch(program, branch)]
    np.testing.assert_allclose(found, [0.015, 0.02, 0.03, 0.04, 0.05, 0.06])
    assert program.kept is branch.launch
    heights, above, crouch = zip(*program.asked, strict=True)
    np.testing.assert_allclose(heights, [0.06, 0.05, 0.04, 0.03, 0.02, 0.015])
    assert above == (0.083, *heights[:-1])
    assert crouch == (0.083,) * 6
    # What the highest launch does not reach is left out.
    found = [launch.rise for launch in build._branch(Staircase(0.034), branch)]
    np.testing.assert_allclose(found, [0.015, 0.02, 0.03, 0.034])


def test_a_branch_without_a_launch_is_refused():
    branch = MARGINS["velocity"].branches[0]
    with pytest.raises(PlanningError, match="keeps the limits"):
        build._branch(Staircase(0.08, [0.08]), branch)
    with pytest.raises(PlanningError, match=r"to 1\.5 cm"):
        build._branch(Staircase(0.08, [0.015]), branch)


class Hulls:
    """The convex hulls of the meshes."""

    def __init__(self):
        path = str(model_path(ROBOT.name))
        self.model = pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer())
        self.geometry = hulls(self.model, ROBOT)
        self.geometry.addAllCollisionPairs()
        names = ROBOT.joint_names
        self.index = [self.model.joints[self.model.getJointId(j)].idx_q for j in names]
        # Neighbours overlap in any posture.
        self.neighbours = set()
        for posture in (ROBOT.crouch, ROBOT.landing):
            self.neighbours |= self.meeting(posture)

    def meeting(self, posture):
        """Pairs of links that overlap, but for neighbours."""
        q = pin.neutral(self.model)
        q[self.index] = posture
        data, results = self.model.createData(), pin.GeometryData(self.geometry)
        pin.computeCollisions(self.model, data, self.geometry, results, q, False)
        found = {k for k, result in enumerate(results.collisionResults) if result.isCollision()}
        return found - self.neighbours


@pytest.fixture(scope="module")
def mesh_hulls():
    pytest.importorskip("coal")
    return Hulls()


def test_no_link_meets_another_in_the_plans(mesh_hulls):
    """Along the launch and the way to the landing posture."""
    for name, member in MEMBERS[::3] + [MEMBERS[-1], MEMBERS[len(FAMILY.rise) - 1]]:
        launch, landing = FAMILIES[name].position[member], FAMILIES[name].landing[member]
        way = [launch[-1] + share * (landing - launch[-1]) for share in (0.3, 0.6, 1.0)]
        for posture in (*launch[::6], *way):
            assert not mesh_hulls.meeting(posture), (name, member, np.degrees(posture))


@pytest.mark.parametrize("controller", ["velocity", "torque"])
def test_no_link_meets_another_in_the_highest_jump(mesh_hulls, controller):
    highest = family_of(ROBOT, controller).highest
    env = make_env(JumpConfig.of(planner="whole_body", jump_height=highest, controller=controller))
    env.reset(seed=0)
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step(np.zeros(3))
        assert not mesh_hulls.meeting(env.data.qpos[7:]), info["time"]
    assert info["outcome"] == "stood"
    assert info["jump"]["self_collisions"] == 0.0
