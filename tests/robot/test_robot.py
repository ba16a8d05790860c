"""The robot value against the URDF and the compiled models."""

import copy
import functools
import pickle
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from icub_jump_env.errors import ConfigError
from icub_jump_env.robot import icub
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.mujoco_model import FLOOR_GEOM, build_model, sole_geom
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.urdf import load_urdf, model_names, model_path

ROBOT = load_robot()
UNSHIFTED = load_robot(ankle_shift=False)
compiled = functools.cache(build_model)
ROBOTS = [load_robot(name) for name in model_names()]
every_robot = pytest.mark.parametrize("robot", ROBOTS, ids=[robot.name for robot in ROBOTS])


@pytest.fixture(scope="module")
def urdf_limits():
    joints = ET.parse(model_path()).getroot().findall("joint")
    return {
        j.attrib["name"]: j.find("limit").attrib for j in joints if j.find("limit") is not None
    }


@pytest.fixture(scope="module")
def model():
    return compiled(ROBOT, 0.001)


def test_leg_limits_are_the_urdfs_and_the_others_are_placeholders_there(urdf_limits):
    for name, ours in zip(
        ROBOT.joint_names, zip(ROBOT.effort_limit, ROBOT.velocity_limit, strict=True), strict=True
    ):
        effort, velocity = (float(urdf_limits[name][k]) for k in ("effort", "velocity"))
        if name.split("_", 1)[1] in (
            "hip_pitch",
            "hip_roll",
            "hip_yaw",
            "knee",
            "ankle_pitch",
            "ankle_roll",
        ):
            assert ours == (effort, velocity)
        else:
            assert effort == velocity == icub.URDF_PLACEHOLDER
            assert ours == ((37.0 if name.startswith("torso") else 20.0), 7.64)


def test_reflected_inertias_follow_from_motor_data():
    expected = {
        "hip_pitch": 0.308,
        "knee": 0.137,
        "torso_yaw": 0.318,
        "torso_pitch": 0.137,
        "elbow": 0.0795,
    }
    for stem, value in expected.items():
        index = next(i for i, name in enumerate(ROBOT.joint_names) if name.endswith(stem))
        assert ROBOT.armature[index] == pytest.approx(value, abs=5e-4)


def test_compiled_model_carries_the_facts(model):
    assert [model.joint(i).name for i in range(1, model.njnt)] == list(ROBOT.joint_names)
    assert [model.actuator(i).name for i in range(model.nu)] == list(ROBOT.joint_names)
    np.testing.assert_array_equal(model.dof_armature[6:], ROBOT.armature)
    np.testing.assert_array_equal(model.dof_armature[:6], 0.0)
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 1], ROBOT.effort_limit)
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 0], -ROBOT.effort_limit)
    np.testing.assert_array_equal(model.actuator_gear[:, 0], 1.0)
    damping = np.where(
        [n[2:].startswith(("hip", "knee", "ankle")) for n in ROBOT.joint_names], 0.223, 0.06
    )
    np.testing.assert_allclose(model.dof_damping[6:], damping)
    assert model.body_mass.sum() == pytest.approx(33.06, abs=0.005)


def test_pinocchio_model_carries_the_facts():
    model = build_pinocchio_model(ROBOT)
    assert tuple(model.names[2:]) == ROBOT.joint_names
    np.testing.assert_array_equal(model.armature[6:], ROBOT.armature)
    np.testing.assert_array_equal(model.effortLimit[6:], ROBOT.effort_limit)
    np.testing.assert_array_equal(model.velocityLimit[6:], ROBOT.velocity_limit)


def test_ankle_shift_moves_only_the_ankle_pitch_ranges():
    shifted, plain = (compiled(robot, 0.001).jnt_range[1:] for robot in (ROBOT, UNSHIFTED))
    moved = np.degrees(shifted - plain)
    for name, row in zip(ROBOT.joint_names, moved, strict=True):
        assert row == pytest.approx(-15.0 if name in icub.ANKLE_PITCH_JOINTS else 0.0)
    ankle = ROBOT.joint_names.index("l_ankle_pitch")
    assert np.degrees(shifted[ankle]) == pytest.approx([-50.0, 20.0])


@pytest.mark.parametrize("robot", [ROBOT, UNSHIFTED], ids=["shifted", "unshifted"])
def test_postures_are_within_the_limits(robot):
    lower, upper = compiled(robot, 0.001).jnt_range[1:].T
    for posture in (robot.crouch, robot.landing):
        assert (posture > lower).all()
        assert (posture < upper).all()


def test_crouch_needs_the_ankle_shift():
    lower = compiled(UNSHIFTED, 0.001).jnt_range[1:, 0]
    assert (lower > ROBOT.crouch).any()


def test_crouch_com_is_above_the_soles():
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(ROBOT.crouch)
    assert ROBOT.sole.x_min + 0.03 < kinematics.com[0] < ROBOT.sole.x_max - 0.03
    assert abs(kinematics.com[1]) < 1e-3
    assert kinematics.com[2] == pytest.approx(0.39, abs=0.005)


def test_landing_com_is_over_the_middle_of_the_soles():
    """Falls were backward while the CoM was 2 cm behind it."""
    kinematics = FeetFixedKinematics(ROBOT)
    kinematics.update(ROBOT.landing)
    assert kinematics.com[0] == pytest.approx(ROBOT.sole.center_x, abs=0.006)


def test_structure_for_users_of_the_mujoco_model(model):
    assert model.body(1).name == ROBOT.base_link
    assert model.jnt_bodyid[0] == 1
    assert model.geom(FLOOR_GEOM).bodyid == 0
    for side, frame in zip("lr", ROBOT.sole_frames, strict=True):
        geom = model.geom(sole_geom(side))
        assert model.body(geom.bodyid[0]).name == frame
        assert geom.size[:2] == pytest.approx([0.08, 0.036])
    links = {link.attrib["name"] for link in ET.fromstring(load_urdf()).findall("link")}
    assert links == {model.body(i).name for i in range(1, model.nbody)}


def test_posture_refuses_unknown_joints():
    with pytest.raises(KeyError):
        icub.posture(wing=3.0)


def mesh_vertices(model, link):
    """Vertices of a link's only mesh, in the link frame."""
    body = model.body(link)
    geoms = [
        model.geom(i)
        for i in range(body.geomadr[0], body.geomadr[0] + body.geomnum[0])
        if model.geom(i).dataid[0] >= 0
    ]
    assert len(geoms) == 1
    mesh = model.mesh(geoms[0].dataid[0])
    first = mesh.vertadr[0]
    vertices = model.mesh_vert[first : first + mesh.vertnum[0]]
    rotation = Rotation.from_quat(geoms[0].quat, scalar_first=True)
    return rotation.apply(vertices) + geoms[0].pos


def test_body_boxes_bound_the_meshes():
    """The contact boxes of a fallen robot against the meshes they stand for."""
    model = compiled(ROBOT, 0.001, visuals=True)
    for link, (center, half_size) in ROBOT.body_boxes.items():
        vertices = mesh_vertices(model, link)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        np.testing.assert_allclose(center, (low + high) / 2, atol=1e-3)
        np.testing.assert_allclose(half_size, (high - low) / 2, atol=1e-3)


def test_meshes_change_nothing_but_the_looks(model):
    pretty = compiled(ROBOT, 0.001, visuals=True)
    assert pretty.nmesh == 39
    for field in (
        "body_mass",
        "body_inertia",
        "body_ipos",
        "body_iquat",
        "dof_armature",
        "jnt_range",
    ):
        np.testing.assert_array_equal(getattr(pretty, field), getattr(model, field))


class TestModels:
    """The iCubs of icub-models."""

    @every_robot
    def test_the_postures_are_the_papers_and_within_the_limits(self, robot):
        np.testing.assert_array_equal(robot.crouch, icub.CROUCH)
        for posture in (robot.crouch, robot.landing):
            assert (posture > robot.lower_position).all()
            assert (posture < robot.upper_position).all()

    @every_robot
    def test_the_ankles_have_the_papers_range(self, robot):
        for joint in icub.ANKLE_PITCH_JOINTS:
            index = robot.joint_names.index(joint)
            ends = robot.lower_position[index], robot.upper_position[index]
            assert np.degrees(ends) == pytest.approx([-50.0, 20.0])

    def test_genova02_has_the_papers_ankles_in_its_urdf(self):
        as_it_is = load_robot("iCubGenova02", ankle_shift=False)
        shifted = load_robot("iCubGenova02")
        np.testing.assert_array_equal(as_it_is.lower_position, shifted.lower_position)
        np.testing.assert_array_equal(as_it_is.upper_position, shifted.upper_position)
        np.testing.assert_array_equal(as_it_is.crouch, ROBOT.crouch)

    @every_robot
    def test_the_sole_is_within_the_foot_and_as_low(self, robot):
        """A box below the mesh would stand on air, one above it would sink in."""
        vertices = mesh_vertices(compiled(robot, 0.001, visuals=True), "l_foot")
        model = build_pinocchio_model(robot)
        sole, foot = (model.frames[model.getFrameId(f)] for f in ("l_sole", "l_foot"))
        assert sole.parentJoint == foot.parentJoint
        foot_in_sole = sole.placement.actInv(foot.placement)
        vertices = vertices @ foot_in_sole.rotation.T + foot_in_sole.translation
        (x_min, y_min, bottom), (x_max, y_max, _) = vertices.min(axis=0), vertices.max(axis=0)
        assert robot.sole.bottom == pytest.approx(bottom, abs=1e-4)
        assert x_min < robot.sole.x_min < robot.sole.x_max < x_max
        assert max(y_min, -y_max) < -robot.sole.half_width

    @pytest.mark.parametrize("name", [*icub.UNPHYSICAL_MODELS, "left_hand_mk3", "Nope", ""])
    def test_what_is_no_jumping_icub_is_refused(self, name):
        with pytest.raises(ConfigError, match="iCubGenova04") as refusal:
            load_robot(name)
        assert (refusal.value.field, refusal.value.value) == ("robot", name)
        assert ("unphysical inertias" in refusal.value.allowed) == (name in icub.UNPHYSICAL_MODELS)

    @pytest.mark.parametrize("robot", [UNSHIFTED, load_robot("iCubGenova02")])
    def test_a_copy_of_a_robot_is_the_one_of_its_name(self, robot):
        ours = load_robot(robot.name, robot.ankle_shift)
        for twin in (copy.deepcopy(robot), pickle.loads(pickle.dumps(robot))):
            assert twin is ours

    def test_nobody_can_change_a_robot(self):
        for name in ("lower_position", "velocity_limit", "armature", "crouch", "landing"):
            with pytest.raises(ValueError, match="read-only"):
                getattr(ROBOT, name)[0] = 1.0


class TestWeights:
    def test_three_are_those_of_legs_torso_and_arms(self):
        weights = ROBOT.per_joint("posture_weight", (1.0, 2.0, 3.0))
        for name, weight in zip(ROBOT.joint_names, weights, strict=True):
            leg = name[2:].startswith(("hip", "knee", "ankle"))
            assert weight == (1.0 if leg else 2.0 if name.startswith("torso") else 3.0)

    def test_one_per_joint_stays(self):
        weights = tuple(np.arange(23.0))
        np.testing.assert_array_equal(ROBOT.per_joint("posture_weight", weights), weights)

    @pytest.mark.parametrize("count", [0, 1, 2, 4, 22, 24])
    def test_other_numbers_are_refused(self, count):
        with pytest.raises(ConfigError, match=r"3 weights .* or 23") as refusal:
            ROBOT.per_joint("posture_weight", (1.0,) * count)
        assert refusal.value.field == "posture_weight"
