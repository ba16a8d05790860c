"""Ankle torques that put the centres of pressure where they shall be, against rigid-body statics."""

import numpy as np
import pinocchio as pin
import pytest
from standing import ROBOT, N

from icub_jump_env.control.ankles import Ankles, ankle_joints, carry
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.robot.kinematics import FeetFixedKinematics, build_pinocchio_model
from icub_jump_env.robot.robot import load_robot

OTHER = "iCubGenova02"
"""Its sole frame is elsewhere."""


def torques(robot, foot_force, cop, pull):
    state = RobotState({"n": robot.n_joints}, foot_force=np.array(foot_force))
    torque = np.zeros(robot.n_joints)
    ankles = Ankles.of(robot).block
    carry(state.block, ankle_joints(robot), np.array(cop), np.array(pull), ankles, torque)
    return torque


@pytest.mark.parametrize("robot", [ROBOT, load_robot(OTHER)], ids=lambda robot: robot.name)
@pytest.mark.parametrize("cop", [(0.03, 0.0), (0.0, 0.02), (-0.04, -0.03)])
@pytest.mark.parametrize("pull", [(0.0, 0.0), (0.2, -0.1)])
def test_they_balance_the_ground_force_at_the_cop(robot, cop, pull):
    """Oracle: the transposed Jacobian of the sole's point on which the ground force acts."""
    foot_force = np.array([220.0, 90.0])
    kinematics = FeetFixedKinematics(robot)
    q = kinematics.configuration(robot.landing)
    model = build_pinocchio_model(robot)
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    found = torques(robot, foot_force, cop, pull)
    for foot, name in enumerate(robot.sole_frames):
        load = foot_force[foot]
        force = load * np.array([pull[0], pull[1], 1.0])
        frame = model.getFrameId(name)
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        place = data.oMf[frame].translation
        point = kinematics.sole_positions[foot] + [cop[0], cop[1], 0.0] - place
        wrench = np.concatenate((force, np.cross(point, force)))
        expected = -(jacobian.T @ wrench)[6:]
        joints = ankle_joints(robot)[foot]
        # The joints' axes do not meet in the ankle: 2 mm of lever.
        np.testing.assert_allclose(found[joints], expected[joints], atol=2e-3 * load)


def test_a_foot_in_the_air_and_the_other_joints_are_left_alone():
    torque = torques(ROBOT, [-3.0, 100.0], (0.02, 0.01), (0.0, 0.0))
    assert sorted(np.flatnonzero(torque)) == sorted(ankle_joints(ROBOT)[1])
    assert len(torque) == N
