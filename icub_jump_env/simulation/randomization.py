"""What may vary from episode to episode, and drawing it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_range, store
from icub_jump_env.errors import ConfigError
from icub_jump_env.robot.icub import FEET_FRICTION
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]
Range = tuple[float, float]

RandomizationName = Literal["none", "mild", "full", "hard", "disturbed"]

HIGHEST_BLOCK = 0.05
"""Height that steps and edges may have, also one on the other (m)."""

_DEG = math.radians(1.0)
_ALLOWED: Mapping[str, Range] = MappingProxyType(
    {
        "link_mass": (0.5, 2.0),
        "payload_mass": (-1.0, 5.0),
        "payload_offset": (0.0, 0.1),
        "friction": (0.05, 3.0),
        "strength": (0.1, 1.0),
        "delay": (0, 20),
        "joint_gain": (0.1, 3.0),
        "damping": (0.0, 20.0),
        "sensor_noise": (0.0, 10.0),
        "slope": (-15 * _DEG, 15 * _DEG),
        "encoder_bias": (-5 * _DEG, 5 * _DEG),
        "push": (-20.0, 20.0),
        "lateral_slope": (-15 * _DEG, 15 * _DEG),
        "push_direction": (-math.pi, math.pi),
        "takeoff_spin": (-5.0, 5.0),
        "flight_push": (-20.0, 20.0),
        "flight_push_time": (0.0, 0.5),
        "flight_push_direction": (-math.pi, math.pi),
        "floor_tilt": (-15 * _DEG, 15 * _DEG),
        "floor_tilt_lateral": (-15 * _DEG, 15 * _DEG),
        "step": (0.0, HIGHEST_BLOCK),
        "edge": (-HIGHEST_BLOCK, HIGHEST_BLOCK),
        "landing_push": (-20.0, 20.0),
        "landing_push_time": (0.0, 5.0),
        "landing_push_direction": (-math.pi, math.pi),
    }
)
_UNITS = {
    "payload_mass": "kg",
    "payload_offset": "m",
    "delay": "ticks",
    "slope": "rad",
    "encoder_bias": "rad",
    "push": "N s",
    "lateral_slope": "rad",
    "push_direction": "rad",
    "takeoff_spin": "rad/s",
    "flight_push": "N s",
    "flight_push_time": "s",
    "flight_push_direction": "rad",
    "floor_tilt": "rad",
    "floor_tilt_lateral": "rad",
    "step": "m",
    "edge": "m",
    "landing_push": "N s",
    "landing_push_time": "s",
    "landing_push_direction": "rad",
}
_STREAM = 100
"""Stream of the disturbances; the sensors have the first ones of the same seed."""


@dataclass(frozen=True)
class Randomization:
    """Ranges, each (low, high), from which each episode draws its world uniformly.

    By default nothing varies. Every range can be set alone; with the same seed each draws
    the same share of its range, whatever the others, the controller or the policy are.

    Pushes act on the chest's CoM for 50 ms, within the horizontal plane: direction 0 is +x,
    pi/2 is +y. What lift-off, apex and touch-down mean:
    :class:`icub_jump_env.simulation.disturbances.Disturbances`.

    Attributes:
        link_mass: Factor on mass and inertia, of each link on its own.
        payload_mass: Point mass added to the chest (kg); negative takes mass away.
        payload_offset: Distance of the payload from the chest's CoM (m), in a random
            direction.
        friction: Coulomb friction of the contact between soles and floor.
        strength: Share of their largest torque that the motors reach, of each joint on its
            own.
        delay: Control ticks until a command takes effect, whole numbers.
        joint_gain: Factor on the servo gains, of each joint on its own.
        damping: Factor on the viscous damping, of each joint on its own.
        sensor_noise: Factor on the noise of the realistic sensors, which comes on top of
            whatever the sensors have.
        slope: Slope of the ground (rad), positive uphill in +x; gravity is tilted, so that
            the world frame stays with the floor.
        encoder_bias: Constant encoder error (rad) of each leg pitch joint: hips, knees,
            ankles.
        push: Impulse on the chest (N s) at a random time of the launch.
        lateral_slope: Slope of the ground (rad), positive uphill in +y.
        push_direction: Direction of that push (rad).
        takeoff_spin: Angular velocity about +y (rad/s) that the robot as a whole is given
            about its CoM at lift-off; the CoM's velocity stays.
        flight_push: Impulse on the chest in flight (N s).
        flight_push_time: When that push begins (s after lift-off); a flight lasts about 0.2 s, and
            later it hits a robot that has landed.
        flight_push_direction: Its direction (rad).
        floor_tilt: Tilt of the floor from the apex on (rad), positive uphill in +x, about the
            point of the floor midway below the soles.
        floor_tilt_lateral: The same (rad), positive uphill in +y.
        step: Height of a block (m) that from the apex on lies under the whole left sole.
        edge: Height of a block (m) that from the apex on lies under the front (positive) or
            the rear (negative) of the left sole: it begins 2 cm ahead of, or behind, the
            sole's middle. It lies on the step, if there is one.
        landing_push: Impulse on the chest after the landing (N s).
        landing_push_time: When that push begins (s after touch-down).
        landing_push_direction: Its direction (rad).

    Raises:
        ConfigError: If a range is out of bounds or upside down.
    """

    link_mass: Range = (1.0, 1.0)
    payload_mass: Range = (0.0, 0.0)
    payload_offset: Range = (0.0, 0.0)
    friction: Range = (FEET_FRICTION, FEET_FRICTION)
    strength: Range = (1.0, 1.0)
    delay: Range = (0, 0)
    joint_gain: Range = (1.0, 1.0)
    damping: Range = (1.0, 1.0)
    sensor_noise: Range = (0.0, 0.0)
    slope: Range = (0.0, 0.0)
    encoder_bias: Range = (0.0, 0.0)
    push: Range = (0.0, 0.0)
    lateral_slope: Range = (0.0, 0.0)
    push_direction: Range = (0.0, 0.0)
    takeoff_spin: Range = (0.0, 0.0)
    flight_push: Range = (0.0, 0.0)
    flight_push_time: Range = (0.02, 0.02)
    flight_push_direction: Range = (0.0, 0.0)
    floor_tilt: Range = (0.0, 0.0)
    floor_tilt_lateral: Range = (0.0, 0.0)
    step: Range = (0.0, 0.0)
    edge: Range = (0.0, 0.0)
    landing_push: Range = (0.0, 0.0)
    landing_push_time: Range = (0.4, 0.4)
    landing_push_direction: Range = (0.0, 0.0)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            low, high = _ALLOWED[field.name]
            unit = _UNITS.get(field.name, "")
            values = check_range(field.name, getattr(self, field.name), low, high, unit)
            store(self, **{field.name: values})
        if any(not bound.is_integer() for bound in self.delay):
            raise ConfigError("delay", self.delay, "whole numbers of control ticks")
        lies_at, most = self.step[1], HIGHEST_BLOCK - self.step[1]
        if max(abs(bound) for bound in self.edge) > most:
            expected = f"bounds within +/- {most:g} m on a step of {lies_at:g} m"
            raise ConfigError("edge", self.edge, expected)

    @property
    def varies(self) -> bool:
        """Whether any world drawn from it can differ from the nominal one."""
        return self != Randomization()

    @property
    def blocks(self) -> bool:
        """Whether any world drawn from it can have a step or an edge."""
        return any(bound != 0.0 for bound in (*self.step, *self.edge))


_FULL = Randomization(
    link_mass=(0.95, 1.05),
    payload_mass=(-0.5, 1.0),
    payload_offset=(0.0, 0.01),
    friction=(0.4, 1.0),
    strength=(0.85, 1.0),
    delay=(0, 2),
    joint_gain=(0.95, 1.05),
    damping=(0.5, 3.0),
    sensor_noise=(1.0, 1.0),
)


def _halved(ranges: Randomization) -> Randomization:
    """Ranges that reach half as far from the nominal values."""
    nominal = Randomization()
    halves = {}
    for field in dataclasses.fields(ranges):
        center = getattr(nominal, field.name)[0]
        halves[field.name] = tuple(
            center + (bound - center) / 2 for bound in getattr(ranges, field.name)
        )
    return Randomization(**halves)


_HARD = dataclasses.replace(
    _FULL,
    slope=(-1.5 * _DEG, 1.5 * _DEG),
    encoder_bias=(-1.0 * _DEG, 1.0 * _DEG),
    push=(-2.0, 2.0),
)

RANDOMIZATIONS: Mapping[RandomizationName, Randomization] = MappingProxyType(
    {
        "none": Randomization(),
        "mild": _halved(_FULL),
        "full": _FULL,
        "hard": _HARD,
        "disturbed": dataclasses.replace(
            _HARD,
            slope=(-4.5 * _DEG, 4.5 * _DEG),
            encoder_bias=(-3.0 * _DEG, 3.0 * _DEG),
            push=(-6.0, 6.0),
        ),
    }
)
"""Ranges by name: ``mild`` is half of ``full``; ``hard`` adds slope, encoder bias and pushes,
``disturbed`` three times as much of these."""


@dataclass(frozen=True, eq=False)
class World:
    """What was drawn for one episode; the meaning is that of :class:`Randomization`.

    Attributes:
        link_mass: (n_links,) factor per link, in MuJoCo's order of bodies.
        payload_mass: kg.
        payload_offset: (3,) m, chest axes.
        friction: Coulomb friction of the contact.
        strength: (n,) share per joint.
        delay: Control ticks.
        joint_gain: (n,) factor per joint.
        damping: (n,) factor per joint.
        sensor_noise: Factor.
        slope: rad.
        encoder_bias: (n,) rad; zero where encoders are right.
        push: N s.
        push_time: When the push begins, as a share of the launch in which it fits.
        lateral_slope: rad.
        push_direction: rad.
        takeoff_spin: rad/s.
        flight_push: N s.
        flight_push_time: s after lift-off.
        flight_push_direction: rad.
        floor_tilt: rad.
        floor_tilt_lateral: rad.
        step: m.
        edge: m.
        landing_push: N s.
        landing_push_time: s after touch-down.
        landing_push_direction: rad.
    """

    link_mass: Array
    payload_mass: float
    payload_offset: Array
    friction: float
    strength: Array
    delay: int
    joint_gain: Array
    damping: Array
    sensor_noise: float
    slope: float
    encoder_bias: Array
    push: float
    push_time: float
    lateral_slope: float = 0.0
    push_direction: float = 0.0
    takeoff_spin: float = 0.0
    flight_push: float = 0.0
    flight_push_time: float = 0.0
    flight_push_direction: float = 0.0
    floor_tilt: float = 0.0
    floor_tilt_lateral: float = 0.0
    step: float = 0.0
    edge: float = 0.0
    landing_push: float = 0.0
    landing_push_time: float = 0.0
    landing_push_direction: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Plain floats and tuples of floats."""
        return {
            field.name: tuple(value.tolist()) if isinstance(value, np.ndarray) else value
            for field in dataclasses.fields(self)
            for value in (getattr(self, field.name),)
        }


def draw_world(
    ranges: Randomization, robot: Robot, n_links: int, rng: np.random.Generator
) -> World:
    """Draw the world of one episode, but for what :func:`draw_disturbances` adds to it.

    Always consumes the same number of random numbers, so that a seed means the same
    world with every range.
    """

    def uniform(bounds: Range, size: int) -> Array:
        return _uniform(rng, bounds, size)

    n = robot.n_joints
    link_mass = uniform(ranges.link_mass, n_links)
    strength = uniform(ranges.strength, n)
    joint_gain = uniform(ranges.joint_gain, n)
    damping = uniform(ranges.damping, n)
    encoder_bias = np.zeros(n)
    biased = robot.leg_pitch_joints
    encoder_bias[biased] = uniform(ranges.encoder_bias, len(biased))
    height, turn = uniform((-1.0, 1.0), 1)[0], uniform((0.0, 2 * math.pi), 1)[0]
    radius = math.sqrt(1.0 - height**2)
    direction = np.array([radius * math.cos(turn), radius * math.sin(turn), height])
    first, last = ranges.delay
    delay = int(uniform((first, last + 1), 1)[0])  # random() is below 1
    scalars = {
        name: float(uniform(getattr(ranges, name), 1)[0])
        for name in ("payload_mass", "friction", "sensor_noise", "slope", "push")
    }
    return World(
        link_mass=link_mass,
        payload_offset=uniform(ranges.payload_offset, 1) * direction,
        strength=strength,
        joint_gain=joint_gain,
        damping=damping,
        encoder_bias=encoder_bias,
        delay=delay,
        push_time=float(rng.random()),
        **scalars,
    )


_DISTURBANCES = (
    "lateral_slope", "push_direction", "takeoff_spin",
    "flight_push", "flight_push_time", "flight_push_direction",
    "floor_tilt", "floor_tilt_lateral", "step", "edge",
    "landing_push", "landing_push_time", "landing_push_direction",
)  # fmt: skip
"""In the order of the draws, which never changes: others can only be appended."""


def draw_disturbances(ranges: Randomization, world: World, seed: int) -> World:
    """Add what disturbs an episode to its ``world``; ``seed`` is that of the sensors' noise.

    From a stream of its own, which leaves all other draws as they were without it.
    """
    rng = np.random.default_rng([seed, _STREAM])
    drawn: dict[str, Any] = {
        name: float(_uniform(rng, getattr(ranges, name), 1)[0]) for name in _DISTURBANCES
    }
    return dataclasses.replace(world, **drawn)


def _uniform(rng: np.random.Generator, bounds: Range, size: int) -> Array:
    low, high = bounds
    # This form gives a bound exactly where both are equal.
    values: Array = low + rng.random(size) * (high - low)
    return values
