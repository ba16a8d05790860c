"""The facts file against the URDF and the compiled models."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from icub_jump_env.robot import facts
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.mujoco_model import FLOOR_GEOM, build_model, sole_geom
from icub_jump_env.robot.urdf import load_urdf, model_path


@pytest.fixture(scope="module")
def urdf_limits():
    joints = ET.parse(model_path()).getroot().findall("joint")
    return {
        j.attrib["name"]: j.find("limit").attrib for j in joints if j.find("limit") is not None
    }


@pytest.fixture(scope="module")
def model():
    return build_model(0.001)


def test_leg_limits_are_the_urdfs_and_the_others_are_placeholders_there(urdf_limits):
    for name, motor in zip(facts.JOINT_NAMES, facts.MOTORS, strict=True):
        effort, velocity = (float(urdf_limits[name][k]) for k in ("effort", "velocity"))
        if name.split("_", 1)[1] in (
            "hip_pitch",
            "hip_roll",
            "hip_yaw",
            "knee",
            "ankle_pitch",
            "ankle_roll",
        ):
            assert (motor.effort, motor.velocity) == (effort, velocity)
        else:
            assert effort == velocity == facts.URDF_PLACEHOLDER
            assert motor.effort == (37.0 if name.startswith("torso") else 20.0)
            assert motor.velocity == 7.64


def test_reflected_inertias_follow_from_motor_data():
    expected = {
        "hip_pitch": 0.308,
        "knee": 0.137,
        "torso_yaw": 0.318,
        "torso_pitch": 0.137,
        "elbow": 0.0795,
    }
    for stem, value in expected.items():
        index = next(i for i, name in enumerate(facts.JOINT_NAMES) if name.endswith(stem))
        assert facts.ARMATURE[index] == pytest.approx(value, abs=5e-4)


def test_compiled_model_carries_the_facts(model):
    assert [model.joint(i).name for i in range(1, model.njnt)] == list(facts.JOINT_NAMES)
    assert [model.actuator(i).name for i in range(model.nu)] == list(facts.JOINT_NAMES)
    np.testing.assert_array_equal(model.dof_armature[6:], facts.ARMATURE)
    np.testing.assert_array_equal(model.dof_armature[:6], 0.0)
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 1], facts.EFFORT_LIMIT)
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 0], -facts.EFFORT_LIMIT)
    np.testing.assert_array_equal(model.actuator_gear[:, 0], 1.0)
    damping = np.where(
        [n[2:].startswith(("hip", "knee", "ankle")) for n in facts.JOINT_NAMES], 0.223, 0.06
    )
    np.testing.assert_allclose(model.dof_damping[6:], damping)
    assert model.body_mass.sum() == pytest.approx(33.06, abs=0.005)


def test_pinocchio_model_carries_the_facts():
    model = build_pinocchio_model()
    assert tuple(model.names[2:]) == facts.JOINT_NAMES
    np.testing.assert_array_equal(model.armature[6:], facts.ARMATURE)
    np.testing.assert_array_equal(model.effortLimit[6:], facts.EFFORT_LIMIT)
    np.testing.assert_array_equal(model.velocityLimit[6:], facts.VELOCITY_LIMIT)


def test_ankle_shift_moves_only_the_ankle_pitch_ranges():
    shifted, plain = (
        build_model(0.001, ankle_shift=shift).jnt_range[1:] for shift in (True, False)
    )
    moved = np.degrees(shifted - plain)
    for name, row in zip(facts.JOINT_NAMES, moved, strict=True):
        assert row == pytest.approx(-15.0 if name in facts.ANKLE_PITCH_JOINTS else 0.0)
    ankle = facts.JOINT_INDEX["l_ankle_pitch"]
    assert np.degrees(shifted[ankle]) == pytest.approx([-50.0, 20.0])


@pytest.mark.parametrize("ankle_shift", [True, False])
def test_postures_are_within_the_limits(ankle_shift):
    lower, upper = build_model(0.001, ankle_shift).jnt_range[1:].T
    for posture in (facts.crouch(ankle_shift), facts.LANDING):
        assert (posture > lower).all()
        assert (posture < upper).all()


def test_crouch_needs_the_ankle_shift():
    lower = build_model(0.001, ankle_shift=False).jnt_range[1:, 0]
    assert (lower > facts.CROUCH).any()


def test_crouch_com_is_above_the_soles():
    kinematics = FeetFixedKinematics()
    kinematics.update(facts.CROUCH)
    assert facts.SOLE.x_min + 0.03 < kinematics.com[0] < facts.SOLE.x_max - 0.03
    assert abs(kinematics.com[1]) < 1e-3
    assert kinematics.com[2] == pytest.approx(0.39, abs=0.005)


def test_landing_com_is_over_the_middle_of_the_soles():
    """Falls were backward while the CoM was 2 cm behind it."""
    kinematics = FeetFixedKinematics()
    kinematics.update(facts.LANDING)
    assert kinematics.com[0] == pytest.approx(facts.SOLE.center_x, abs=0.006)


def test_structure_for_users_of_the_mujoco_model(model):
    assert model.body(1).name == facts.BASE_LINK
    assert model.jnt_bodyid[0] == 1
    assert model.geom(FLOOR_GEOM).bodyid == 0
    for side, frame in zip("lr", facts.SOLE_FRAMES, strict=True):
        geom = model.geom(sole_geom(side))
        assert model.body(geom.bodyid[0]).name == frame
        assert geom.size[:2] == pytest.approx([0.08, 0.036])
    links = {link.attrib["name"] for link in ET.fromstring(load_urdf()).findall("link")}
    assert links == {model.body(i).name for i in range(1, model.nbody)}


def test_posture_refuses_unknown_joints():
    with pytest.raises(KeyError):
        facts.posture(wing=3.0)


def test_body_boxes_bound_the_meshes():
    """The contact boxes of a fallen robot against the meshes they stand for."""
    model = build_model(0.001, visuals=True)
    for link, (center, half_size) in facts.BODY_BOXES.items():
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
        vertices = rotation.apply(vertices) + geoms[0].pos
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        np.testing.assert_allclose(center, (low + high) / 2, atol=1e-3)
        np.testing.assert_allclose(half_size, (high - low) / 2, atol=1e-3)


def test_meshes_change_nothing_but_the_looks(model):
    pretty = build_model(0.001, visuals=True)
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
