"""Fit the capsules of :mod:`icub_jump_env.robot.collision` to the meshes.

    python -m experiments.collision_shapes

They are fitted where it matters: such that the distances between links come out as between the
convex hulls of the meshes, in postures in which links are close. Prints the capsules, and how far
they are off in postures that were not used for the fit.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rich.console import Console
from scipy.optimize import least_squares

from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.planning.whole_body.family import family_of
from icub_jump_env.robot.collision import LINK_PAIRS, Capsule
from icub_jump_env.robot.robot import Robot, load_robot
from icub_jump_env.robot.urdf import mesh_root, model_path

Array = NDArray[np.float64]
Shapes = dict[str, list[Capsule]]

CAPSULES_PER_LINK = {
    "root_link": 1,
    "chest": 1,
    "l_upper_leg": 2,
    "l_lower_leg": 1,
    "l_foot": 1,
    "l_upper_arm": 1,
    "l_forearm": 1,
    "l_hand": 2,
}
"""Those of the right side, also of root and chest, are their mirror images."""

CLOSE = 0.03
"""Links are close within this distance (m), or this deep in each other."""

_PER_PAIR = 150
"""Postures of each pair that the fit uses."""

_CLEARANCE = 0.001
"""At least this distance (m) is left in the postures of the jumps, where hulls have it."""


@dataclass(frozen=True)
class FitOptions:
    """Fit the collision shapes of the default robot.

    Attributes:
        postures: Random postures, for the fit and for the check.
    """

    postures: int = 3000


@dataclass(frozen=True)
class Samples:
    """Postures and what the hulls say of them.

    Attributes:
        poses: Rotation and position by link, (k, 3, 3) and (k, 3).
        distance: (k, pairs) distance between hulls, negative where they overlap (m).
    """

    poses: dict[str, tuple[Array, Array]]
    distance: Array


class HullModel:
    """The convex hulls of the links' meshes."""

    def __init__(self, robot: Robot) -> None:
        """Read the meshes from icub-models."""
        path = str(model_path(robot.name))
        self.model = pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer())
        self._geometry = hulls(self.model, robot)
        for pair in LINK_PAIRS:
            ids = (self._geometry.getGeometryId(f"{link}_0") for link in pair)
            self._geometry.addCollisionPair(pin.CollisionPair(*ids))
        self._index = [
            self.model.joints[self.model.getJointId(joint)].idx_q for joint in robot.joint_names
        ]
        links = dict.fromkeys(link for pair in LINK_PAIRS for link in pair)
        self.frames = {link: self.model.getFrameId(link) for link in links}

    def sample(self, postures: Sequence[Array]) -> Samples:
        """Poses and distances in postures, (n,) each."""
        data, results = self.model.createData(), pin.GeometryData(self._geometry)
        poses, distances = [], []
        for posture in postures:
            q = pin.neutral(self.model)
            q[self._index] = posture
            pin.computeDistances(self.model, data, self._geometry, results, q)
            distances.append([found.min_distance for found in results.distanceResults])
            pin.updateFramePlacements(self.model, data)
            poses.append([data.oMf[frame].homogeneous for frame in self.frames.values()])
        H = np.array(poses)
        by_link = {link: (H[:, i, :3, :3], H[:, i, :3, 3]) for i, link in enumerate(self.frames)}
        return Samples(by_link, np.array(distances))

    def points(self, link: str) -> Array:
        """(k, 3) points of a hull, in the frame of its link (m)."""
        shape = self._geometry.geometryObjects[self._geometry.getGeometryId(f"{link}_0")]
        X = self.model.frames[self.frames[link]].placement.actInv(shape.placement)
        return np.array([X.act(point) for point in shape.geometry.points()])


def hulls(model: pin.Model, robot: Robot) -> pin.GeometryModel:
    """The robot's collision meshes, each replaced by its convex hull."""
    geometry = pin.buildGeomFromUrdf(
        model,
        str(model_path(robot.name)),
        pin.GeometryType.COLLISION,
        package_dirs=[str(mesh_root(robot.name).parent)],
    )
    for shape in geometry.geometryObjects:
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry.buildConvexHull(False, "Qt")
            shape.geometry = shape.geometry.convex
    return geometry


def jump_postures(robot: Robot) -> list[Array]:
    """(n,) postures of the package's jumps."""
    family = family_of(robot, "velocity")
    launches = [posture for launch in family.position[::2] for posture in launch[::6]]
    return [robot.crouch, robot.landing, *launches, *family.landing]


def random_postures(robot: Robot, count: int, rng: np.random.Generator) -> list[Array]:
    """Postures around those of the jumps, every other one symmetric."""
    jumps = jump_postures(robot)
    found = []
    for i in range(count):
        offset = rng.choice([0.05, 0.2, 0.5]) * rng.normal(size=robot.n_joints)
        if i % 2:
            offset[robot.right_leg] = offset[robot.left_leg]
            left, right = np.split(np.arange(robot.n_joints)[robot.arms], 2)
            offset[right] = offset[left]
            offset[robot.torso][1:] = 0.0
        posture = jumps[rng.integers(len(jumps))] + offset
        found.append(np.clip(posture, robot.lower_position, robot.upper_position))
    return found


class CapsuleModel:
    """Capsules as a vector of parameters: start, end and radius of each on the left (m)."""

    def __init__(self, hull_model: HullModel) -> None:
        """Find the mirror image of each link's frame, in the posture of zeros."""
        model = hull_model.model
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.neutral(model))
        self._frames = {link: data.oMf[frame] for link, frame in hull_model.frames.items()}

    def guess(self, hull_model: HullModel) -> Array:
        """Capsules along the hulls' principal axes."""
        parameters: list[float] = []
        for link, count in CAPSULES_PER_LINK.items():
            points = hull_model.points(link)
            if _is_central(link):
                left = self._frames[link].rotation[1]
                center = (points.min(axis=0) + points.max(axis=0)) / 2
                points = points[(points - center) @ left > 0]
            center = (points.min(axis=0) + points.max(axis=0)) / 2
            axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
            half = np.ptp(points @ axes.T, axis=0) / 2
            radius = 0.8 * (np.sqrt(half[1] * half[2]) if count == 1 else half[1:].min())
            along = max(half[0] - radius, 0.005) * axes[0]
            apart = max(half[1] - radius, 0.01) * axes[1]
            for k in range(count):
                middle = center + (k - (count - 1) / 2) * apart
                parameters += [*(middle - along), *(middle + along), radius]
        return np.array(parameters)

    def shapes(self, parameters: Array) -> Shapes:
        """The capsules of all links."""
        rows = iter(parameters.reshape(-1, 7))
        shapes: Shapes = {}
        for link, count in CAPSULES_PER_LINK.items():
            own = [_capsule(next(rows)) for _ in range(count)]
            mirrored = [self._mirrored(link, capsule) for capsule in own]
            if _is_central(link):
                shapes[link] = own + mirrored
            else:
                shapes[link], shapes[f"r_{link[2:]}"] = own, mirrored
        return shapes

    def _mirrored(self, link: str, capsule: Capsule) -> Capsule:
        other = link if _is_central(link) else f"r_{link[2:]}"
        flip = np.array([1.0, -1.0, 1.0])
        start, end = (
            tuple(self._frames[other].actInv(flip * self._frames[link].act(np.array(point))))
            for point in capsule[:2]
        )
        return Capsule(start, end, capsule.radius)


def _is_central(link: str) -> bool:
    return not link.startswith(("l_", "r_"))


def _capsule(row: Array) -> Capsule:
    return Capsule(tuple(row[:3]), tuple(row[3:6]), abs(row[6]))


def distances(shapes: Shapes, samples: Samples) -> Array:
    """(k, pairs) distance between the shapes of the links, as :attr:`Samples.distance`."""
    placed = {
        link: [
            (R @ np.array(capsule.start) + p, R @ np.array(capsule.end) + p, capsule.radius)
            for capsule in shapes[link]
        ]
        for link, (R, p) in samples.poses.items()
    }
    columns = []
    for first, second in LINK_PAIRS:
        between = [
            segment_distance(start, end, other_start, other_end) - radius - other_radius
            for start, end, radius in placed[first]
            for other_start, other_end, other_radius in placed[second]
        ]
        columns.append(np.min(between, axis=0))
    return np.stack(columns, axis=1)


def segment_distance(p1: Array, q1: Array, p2: Array, q2: Array) -> Array:
    """(k,) distance between segments p1 q1 and p2 q2, (k, 3) each.

    Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, r = q1 - p1, q2 - p2, p1 - p2
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    ur, vr = _dot(u, r), _dot(v, r)
    area = uu * vv - uv**2
    parallel = area < 1e-12
    s = np.where(parallel, 0.0, (uv * vr - ur * vv) / np.where(parallel, 1.0, area)).clip(0, 1)
    t = ((uv * s + vr) / vv).clip(0, 1)
    s = ((uv * t - ur) / uu).clip(0, 1)
    distance: Array = np.linalg.norm(r + s[:, None] * u - t[:, None] * v, axis=1)
    return distance


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ki,ki->k", a, b)
    return product


def fit(capsules: CapsuleModel, guess: Array, near: Samples, jumps: Samples) -> Shapes:
    """The shapes with the least errors of distance.

    Args:
        capsules: The parameters' meaning.
        guess: Where the search starts.
        near: Random postures.
        jumps: Those of the jumps, where shapes must not touch unless hulls do.
    """
    close = np.abs(near.distance) < CLOSE
    used = close & (close.cumsum(axis=0) <= _PER_PAIR)
    weight = (1.5 - np.abs(near.distance) / CLOSE) / np.sqrt(used.sum(axis=0).clip(1))
    clear = np.minimum(jumps.distance, _CLEARANCE)

    def residuals(parameters: Array) -> Array:
        shapes = capsules.shapes(parameters)
        error = (weight * (distances(shapes, near) - near.distance))[used]
        overlap = (clear - distances(shapes, jumps)).clip(0.0)
        return np.concatenate((error / 0.005, overlap.ravel() / 0.001, (parameters - guess) * 2))

    found = least_squares(residuals, guess, loss="soft_l1", max_nfev=60)
    return capsules.shapes(np.round(found.x, 3))


def run(options: FitOptions) -> None:
    """Fit, check, print."""
    robot, rng = load_robot(), np.random.default_rng(0)
    hull_model = HullModel(robot)
    capsules = CapsuleModel(hull_model)
    jumps = hull_model.sample(jump_postures(robot))
    near = hull_model.sample(random_postures(robot, options.postures, rng))
    shapes = fit(capsules, capsules.guess(hull_model), near, jumps)
    for link, own in shapes.items():
        print(f'"{link}": (')
        for start, end, radius in own:
            print(f"    Capsule({_rounded(start)}, {_rounded(end)}, {radius:.3f}),")
        print("),")
    fresh = hull_model.sample(random_postures(robot, options.postures, rng))
    table = new_table(2, "link", "other link", "postures", "error, mm", "alike, %")
    for pair, hull, ours in zip(
        LINK_PAIRS, fresh.distance.T, distances(shapes, fresh).T, strict=True
    ):
        close = np.abs(hull) < CLOSE
        error = np.sqrt(np.mean((ours - hull)[close] ** 2))
        alike = np.mean((ours < 0) == (hull < 0), where=close)
        table.add_row(*pair, f"{close.sum()}", f"{1e3 * error:.1f}", f"{100 * alike:.0f}")
    table.caption = (
        f"postures within {1e3 * CLOSE:g} mm; error: root mean square of the distance; alike: "
        "hulls and capsules both overlap, or neither does"
    )
    show(Console(), table)


def _rounded(point: Sequence[float]) -> str:
    # No negative zeros.
    return f"({', '.join(f'{round(x, 3) + 0.0:.3f}' for x in point)})"


if __name__ == "__main__":
    guarded(lambda: run(parse(FitOptions, sys.argv[1:])))
