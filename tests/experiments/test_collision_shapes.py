"""The collision shapes against the meshes they stand for."""

import numpy as np
import pytest

pytest.importorskip("coal")

from experiments.collision_shapes import (
    CLOSE,
    HullModel,
    distances,
    jump_postures,
    random_postures,
    segment_distance,
)
from icub_jump_env.robot.collision import CAPSULES, LINK_PAIRS
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.self_collision import SelfCollision

ROBOT = load_robot()


@pytest.fixture(scope="module")
def hull_model():
    return HullModel(ROBOT)


@pytest.fixture(scope="module")
def near(hull_model):
    return hull_model.sample(random_postures(ROBOT, 500, np.random.default_rng(1)))


def test_they_are_where_the_hulls_are(near):
    found = distances(CAPSULES, near)
    close = np.abs(near.distance) < CLOSE
    error = (found - near.distance)[close]
    assert np.sqrt(np.mean(error**2)) < 0.006
    assert abs(np.median(error)) < 0.002
    assert np.mean((found < 0) == (near.distance < 0), where=close) > 0.92
    for k, pair in enumerate(LINK_PAIRS):
        if close[:, k].sum() > 20:
            off = (found - near.distance)[close[:, k], k]
            assert np.sqrt(np.mean(off**2)) < 0.012, pair


def test_they_are_clear_in_the_postures_of_the_jumps(hull_model):
    """To the millimetre in which they are written down."""
    jumps = hull_model.sample(jump_postures(ROBOT))
    assert (jumps.distance.min() > 0) == (distances(CAPSULES, jumps).min() > -1e-3)


def test_the_simulator_measures_them_alike(near):
    """The deepest overlap, by MuJoCo and by the formula of the fit."""
    shapes = SelfCollision(ROBOT)
    rng = np.random.default_rng(1)
    ours = -distances(CAPSULES, near).min(axis=1).clip(max=0.0)
    for posture, depth in zip(random_postures(ROBOT, 500, rng)[:100], ours, strict=False):
        qpos = np.concatenate(([0, 0, 1, 1, 0, 0, 0], posture))
        assert shapes.overlap(qpos) == pytest.approx(depth, abs=1e-5)


def test_segment_distance(rng):
    """Against the least of many points."""
    p1, q1, p2, q2 = rng.normal(size=(4, 20, 3))
    s, t = np.meshgrid(*[np.linspace(0, 1, 201)] * 2)
    one = p1[:, None, None] + s[..., None] * (q1 - p1)[:, None, None]
    two = p2[:, None, None] + t[..., None] * (q2 - p2)[:, None, None]
    nearest = np.linalg.norm(one - two, axis=-1).min(axis=(1, 2))
    np.testing.assert_allclose(segment_distance(p1, q1, p2, q2), nearest, atol=2e-3)
