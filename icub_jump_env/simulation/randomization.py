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

RandomizationName = Literal["none", "mild", "full", "hard"]

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
    }
)
_UNITS = {
    "payload_mass": "kg",
    "payload_offset": "m",
    "delay": "ticks",
    "slope": "rad",
    "encoder_bias": "rad",
    "push": "N s",
}


@dataclass(frozen=True)
class Randomization:
    """Ranges, each (low, high), from which each episode draws its world uniformly.

    By default nothing varies. Every range can be set alone; with the same seed each draws
    the same share of its range, whatever the others, the controller or the policy are.

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
        push: Impulse on the chest along +x (N s), over 50 ms at a random time of the
            launch.

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

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            low, high = _ALLOWED[field.name]
            unit = _UNITS.get(field.name, "")
            values = check_range(field.name, getattr(self, field.name), low, high, unit)
            store(self, **{field.name: values})
        if any(not bound.is_integer() for bound in self.delay):
            raise ConfigError("delay", self.delay, "whole numbers of control ticks")

    @property
    def varies(self) -> bool:
        """Whether any world drawn from it can differ from the nominal one."""
        return self != Randomization()


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


RANDOMIZATIONS: Mapping[RandomizationName, Randomization] = MappingProxyType(
    {
        "none": Randomization(),
        "mild": _halved(_FULL),
        "full": _FULL,
        "hard": dataclasses.replace(
            _FULL,
            slope=(-1.5 * _DEG, 1.5 * _DEG),
            encoder_bias=(-1.0 * _DEG, 1.0 * _DEG),
            push=(-2.0, 2.0),
        ),
    }
)
"""Ranges by name: ``mild`` is half of ``full``; ``hard`` adds slope, encoder bias and pushes."""


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
    """Draw the world of one episode.

    Always consumes the same number of random numbers, so that a seed means the same
    world with every range.
    """

    def uniform(bounds: Range, size: int) -> Array:
        low, high = bounds
        # This form gives a bound exactly where both are equal.
        values: Array = low + rng.random(size) * (high - low)
        return values

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
