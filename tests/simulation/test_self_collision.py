"""Links in each other: the shapes, the contacts between them, and who counts."""

import copy

import numpy as np
import pytest
from conftest import ZERO

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.robot.collision import CAPSULES, LINK_PAIRS, TOLERANCE
from icub_jump_env.robot.icub import CROUCH
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.self_collision import SelfCollision

ROBOT = load_robot()


def floating(**joints):
    """MuJoCo positions high above the floor: the crouch but for some joints (rad)."""
    posture = CROUCH.copy()
    for name, value in joints.items():
        posture[ROBOT.joint_names.index(name)] = value
    return np.concatenate(([0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0], posture))


CLASPED = {"l_shoulder_roll": 0.0, "r_shoulder_roll": 0.0, "l_elbow": 0.3, "r_elbow": 0.3}
"""Hands in the thighs."""


def test_crouch_and_landing_are_clear():
    shapes = SelfCollision(ROBOT)
    for posture in (ROBOT.crouch, ROBOT.landing):
        assert shapes.overlap(np.concatenate((floating()[:7], posture))) == 0.0


def test_hands_in_thighs_are_seen_wherever_the_robot_is():
    shapes = SelfCollision(ROBOT)
    qpos = floating(**CLASPED)
    depth = shapes.overlap(qpos)
    assert depth > 0.01
    qpos[:7] = 0.3, -0.2, 0.4, 0.8, 0.0, 0.6, 0.0
    assert shapes.overlap(qpos) == pytest.approx(depth, abs=1e-9)


def test_a_copy_sees_the_same():
    shapes = SelfCollision(ROBOT)
    assert copy.deepcopy(shapes).overlap(floating(**CLASPED)) == shapes.overlap(
        floating(**CLASPED)
    )


def test_every_pair_and_its_mirror_image():
    mirrored = {"l": "r", "r": "l"}
    pairs = {frozenset(links) for links in LINK_PAIRS}
    assert len(pairs) == len(LINK_PAIRS)
    for links in LINK_PAIRS:
        assert (
            frozenset(mirrored.get(x[0], x[0]) + x[1:] if x[1] == "_" else x for x in links)
            in pairs
        )
        assert set(links) <= set(CAPSULES)


@pytest.mark.parametrize("self_collision", [False, True])
def test_contacts_keep_arms_out_of_thighs(self_collision):
    """Shoulders and elbows are pulled in."""
    physics = Physics(ROBOT, 0.001, self_collision=self_collision)
    shapes = SelfCollision(ROBOT)
    physics.reset(floating())
    physics.model.opt.gravity[:] = 0.0
    target = floating(**CLASPED)[7:]
    for _ in range(400):
        error = target - physics.joint_position
        physics.control[:] = 30.0 * error - 2.0 * physics.joint_velocity
        physics.step()
    depth = shapes.overlap(physics.data.qpos)
    assert (depth < TOLERANCE) if self_collision else (depth > 0.01)


def test_contacts_are_internal_forces():
    """They push the joints, but not the robot as a whole."""
    physics = Physics(ROBOT, 0.001, self_collision=True)
    physics.reset(floating(**CLASPED))
    force = physics.data.qfrc_constraint
    assert np.abs(force[6:]).max() > 10.0
    np.testing.assert_allclose(force[:6], 0.0, atol=1e-9)


def test_the_paper_jump_never_touches_itself():
    """So that contacts between links change no bit of it."""
    seen = []
    for self_collision in (False, True):
        env = make_env(JumpConfig(self_collision=self_collision))
        env.reset(seed=0)
        terminated = False
        while not terminated:
            *_, terminated, _, info = env.step(ZERO)
        seen.append(info["jump"])
        assert info["jump"]["self_collisions"] == 0.0
    assert seen[0] == seen[1]


@pytest.mark.parametrize("agent_frequency", [100.0, 200.0])
def test_steps_in_which_links_overlap_are_counted(agent_frequency, monkeypatch):
    env = make_env(JumpConfig(agent_frequency=agent_frequency))
    depths = iter([0.0, 2 * TOLERANCE, 0.9 * TOLERANCE, 2 * TOLERANCE] + [0.0] * 100)
    env.reset(seed=0)
    monkeypatch.setattr(env._self_collision, "overlap", lambda _: next(depths))
    for _ in range(round(0.1 * agent_frequency)):
        *_, info = env.step(ZERO)
    assert info["jump"]["self_collisions"] == 2.0
    assert len(list(depths)) == 104 - 10
    _, info = env.reset(seed=0)
    assert info["jump"]["self_collisions"] == 0.0
