"""Families of whole-body plans over the commanded height, and their files.

A family is an npz file with the joint trajectories and, beside it, a JSON card that says how
they were made. Neither can carry code, and following them needs no CasADi.
"""

from __future__ import annotations

import functools
import hashlib
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.carded import read_carded, write_carded
from icub_jump_env.errors import HeightNotReachableError, PlanFileError
from icub_jump_env.planning.whole_body.plan import JointKnots, WholeBodyPlan
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]

FORMAT = 1
"""Format of the files."""

MAX_SIZE = 2**24
"""Largest file that is read (bytes)."""

SHIPPED = Path(__file__).parent / "shipped"
"""Families of the default robot."""

_DIMENSIONS = {
    "rise": 1, "branch": 1, "duration": 1,
    "position": 3, "velocity": 3, "acceleration": 3, "landing": 2, "retraction": 1,
}  # fmt: skip
"""Arrays of the file, and the number of their dimensions; the first is the plan."""

ARRAYS = tuple(_DIMENSIONS)
"""Their names."""


@dataclass(frozen=True, eq=False)
class PlanFamily:
    """Plans of one robot and controller, by ascending rise within each branch.

    Attributes:
        rise: (m,) rise that the controller makes of each plan in the nominal simulation (m).
        branch: (m,) plans of one branch can be interpolated; branches ascend, and overlap.
        duration: (m,) T (s).
        position, velocity, acceleration: (m, k, n) joints at the knots (rad, rad/s, rad/s^2).
        landing: (m, n) posture of flight and landing (rad).
        retraction: (m,) duration of the motion to it (s).
        card: How they were made; plain values. What binds in each plan stands there.
    """

    rise: Array
    branch: NDArray[np.int64]
    duration: Array
    position: Array
    velocity: Array
    acceleration: Array
    landing: Array
    retraction: Array
    card: Mapping[str, Any]

    @property
    def lowest(self) -> float:
        """Lowest command (m)."""
        return float(self.rise[0])

    @property
    def highest(self) -> float:
        """Highest command (m)."""
        return float(self.rise[-1])

    @property
    def optimum(self) -> float:
        """Rise (m) of the highest launch within the robot's limits: no margins, no controller."""
        return float(self.card["optimum"]["height"])

    def check_height(self, jump_height: float) -> None:
        """Refuse a command that no plan reaches.

        Raises:
            HeightNotReachableError: Naming the range, and what binds at the highest plan.
        """
        if jump_height > self.highest:
            raise HeightNotReachableError(
                "jump_height",
                jump_height,
                f"at most {math.floor(1e4 * self.highest) / 1e4} m with planner='whole_body' and the "
                f"{self.card['controller']} controller, where the plan is bound by "
                f"{', '.join(self.card['plans'][-1]['binding'])}",
            )
        if jump_height < self.lowest:
            raise HeightNotReachableError(
                "jump_height",
                jump_height,
                f"at least {math.ceil(1e4 * self.lowest) / 1e4} m with planner='whole_body'",
            )

    def plan(self, jump_height: float, kinematics: FeetFixedKinematics) -> WholeBodyPlan:
        """The plan of a command (m), interpolated.

        Args:
            jump_height: The command.
            kinematics: The model; it is updated for the crouch.

        Raises:
            HeightNotReachableError: If no plan reaches it.
        """
        self.check_height(jump_height)
        reaching = [
            b for b in np.unique(self.branch) if jump_height <= self.rise[self.branch == b][-1]
        ]
        members = np.flatnonzero(self.branch == reaching[0])
        rise = self.rise[members]
        after = min(max(int(np.searchsorted(rise, jump_height)), 1), len(rise) - 1)
        share = (jump_height - rise[after - 1]) / (rise[after] - rise[after - 1])
        pair = members[[after - 1, after]]
        weights = np.array([1.0 - share, share])

        def mix(values: Array) -> Array:
            mixed: Array = np.tensordot(weights, values, 1)
            return mixed

        # The trajectories are interpolated over the share of T, hence their rates.
        T = self.duration[pair]
        duration = float(mix(T))
        scale = T[:, None, None] / duration
        knots = JointKnots(
            duration,
            mix(self.position[pair]),
            mix(self.velocity[pair] * scale),
            mix(self.acceleration[pair] * scale**2),
        )
        return WholeBodyPlan(
            knots, mix(self.landing[pair]), float(mix(self.retraction[pair])), kinematics
        )

    def save(self, path: Path) -> None:
        """Write the ``.npz`` file and its ``.json`` card.

        Raises:
            OSError: If the file system refuses.
        """
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **{name: getattr(self, name) for name in _DIMENSIONS})
        write_carded(path.with_suffix(".npz"), buffer.getvalue(), self.card, PlanFileError)


def load_family(path: Path) -> PlanFamily:
    """Read a family.

    Args:
        path: The ``.npz`` file or its ``.json`` card.

    Raises:
        PlanFileError: If a file is missing or damaged, or they do not belong together.
    """
    file = path.with_suffix(".npz")
    content, card = read_carded(file, MAX_SIZE, PlanFileError)
    if card.get("format") != FORMAT:
        raise PlanFileError(str(file), f"its card is not of format {FORMAT}")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            values = {name: arrays[name] for name in _DIMENSIONS}
    except (KeyError, ValueError, OSError) as error:
        raise PlanFileError(str(file), f"not a family of plans ({error})") from None
    for name, dimensions in _DIMENSIONS.items():
        value = values[name]
        if value.ndim != dimensions or len(value) != len(values["rise"]):
            raise PlanFileError(str(file), f"{name} has the shape {value.shape}")
        if not np.isfinite(value).all():
            raise PlanFileError(str(file), f"{name} is not finite")
        value.setflags(write=False)
    family = PlanFamily(**values, card=card)
    _check(file, family)
    return family


def _check(file: Path, family: PlanFamily) -> None:
    """Refuse what cannot be interpolated, and a card without what errors quote.

    Raises:
        PlanFileError: If something does not fit.
    """
    shape = family.position.shape
    if not (family.velocity.shape == family.acceleration.shape == shape and shape[1] > 1):
        raise PlanFileError(str(file), "joint trajectories of different shapes")
    if family.landing.shape[1] != shape[2]:
        raise PlanFileError(str(file), "a landing posture of other joints")
    steps, new = np.diff(family.rise), np.diff(family.branch) != 0
    members = np.unique(family.branch, return_counts=True)[1]
    if not members.size or members.min() < 2 or (steps[~new] <= 0).any():
        raise PlanFileError(str(file), "each branch needs two plans or more, in ascending order")
    if not (family.duration > 0).all() or not (family.retraction > 0).all():
        raise PlanFileError(str(file), "durations that are not positive")
    plans = family.card.get("plans")
    if not isinstance(plans, list) or len(plans) != shape[0]:
        raise PlanFileError(str(file), "a card of other plans")
    for plan in (*plans, family.card.get("optimum")):
        if not isinstance(plan, dict) or not _says_what_binds(plan.get("binding")):
            raise PlanFileError(str(file), "a card that does not say what binds")
        if not isinstance(plan.get("height"), float) or not plan["height"] > 0:
            raise PlanFileError(str(file), "a card that does not say how high its plans go")


def _says_what_binds(binding: Any) -> bool:
    return isinstance(binding, dict) and all(
        isinstance(times, list) and [type(time) for time in times] == [float, float]
        for times in binding.values()
    )


def family_of(robot: Robot, controller: str, path: Path | None = None) -> PlanFamily:
    """The family of a robot and a controller.

    Args:
        robot: The robot.
        controller: Name of the controller.
        path: File of the family; by default the one of the package.

    Raises:
        PlanFileError: If there is none, or it is of another robot or controller.
    """
    file = SHIPPED / f"{robot.name}-{controller}.npz" if path is None else path.with_suffix(".npz")
    written = file.stat().st_mtime_ns if file.is_file() else None
    return _family_of(robot, controller, file, written)


@functools.lru_cache(maxsize=16)
def _family_of(robot: Robot, controller: str, file: Path, written: int | None) -> PlanFamily:
    """The family in a file, read once for each time that it is written."""
    if written is None:
        raise PlanFileError(str(file), "no such file; python -m icub_jump_env.planning makes one")
    family = load_family(file)
    if family.position.shape[2] != robot.n_joints:
        raise PlanFileError(str(file), "trajectories of other joints")
    for name, ours in (
        ("robot", robot.name), ("controller", controller), ("model", model_hash(robot)),
    ):  # fmt: skip
        if family.card.get(name) != ours:
            raise PlanFileError(
                str(file), f"{name} is {family.card.get(name)!r} instead of {ours!r}"
            )
    return family


def model_hash(robot: Robot) -> str:
    """What the plans of a robot depend on, as a hash in hexadecimal."""
    return hashlib.sha256(robot.urdf().encode()).hexdigest()


class WholeBodyPlanner:
    """Makes plans of a family; that of the latest command is kept."""

    def __init__(self, family: PlanFamily, kinematics: FeetFixedKinematics) -> None:
        """Set up the planner.

        Args:
            family: The plans.
            kinematics: The model; a new command updates it for the crouch.
        """
        self._family, self._kinematics = family, kinematics
        self._latest: tuple[float, WholeBodyPlan] | None = None

    def plan(self, jump_height: float) -> WholeBodyPlan:
        """The plan of a jump to a commanded height (m).

        Raises:
            HeightNotReachableError: If no plan reaches it.
        """
        if self._latest is None or self._latest[0] != jump_height:
            self._latest = jump_height, self._family.plan(jump_height, self._kinematics)
        return self._latest[1]
