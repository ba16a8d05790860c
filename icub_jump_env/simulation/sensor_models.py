"""How wrong the sensors are."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np

from icub_jump_env.checks import check_count, check_number, check_type, store
from icub_jump_env.records import Array, Block, PerJoint, Record, Vector

SensorName = Literal["ideal", "realistic"]

MAX_DELAY = 100
"""Longest delay (control ticks)."""


@dataclass(frozen=True)
class SensorError:
    """Error of one kind of reading, in the reading's unit.

    Attributes:
        noise: Standard deviation of white Gaussian noise, drawn at each reading.
        bias: Largest constant offset; drawn uniformly in +- at each reset.
        drift: Largest rate (1/s) at which the offset grows from the reset on; drawn
            uniformly in +- at each reset.

    Raises:
        ConfigError: If a value is out of range.
    """

    noise: float = 0.0
    bias: float = 0.0
    drift: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (
            ("noise", "units of the reading"),
            ("bias", "units of the reading"),
            ("drift", "units of the reading per s"),
        ):
            store(self, **{name: check_number(name, getattr(self, name), 0.0, 1e4, unit)})


@dataclass(frozen=True)
class SensorConfig:
    """Errors of all sensors.

    Attributes:
        joint_position: Encoders (rad). The servos read encoders with this bias, too.
        joint_velocity: Encoders (rad/s).
        tilt: Direction of gravity from the IMU (rad about each of its axes).
        gyro: Angular velocity from the IMU (rad/s).
        accelerometer: Specific force from the IMU (m/s^2).
        force: Force under a foot, each axis (N).
        moment: Moment about the middle of a sole, each axis (Nm).
        force_gain: Largest calibration error of the forces under a foot, as a share;
            drawn uniformly in +- per foot at each reset.
        delay: Age of all readings in control ticks.

    Raises:
        ConfigError: If a value is out of range.
    """

    joint_position: SensorError = field(default_factory=SensorError)
    joint_velocity: SensorError = field(default_factory=SensorError)
    tilt: SensorError = field(default_factory=SensorError)
    gyro: SensorError = field(default_factory=SensorError)
    accelerometer: SensorError = field(default_factory=SensorError)
    force: SensorError = field(default_factory=SensorError)
    moment: SensorError = field(default_factory=SensorError)
    force_gain: float = 0.0
    delay: int = 0

    def __post_init__(self) -> None:
        for name in ERROR_KINDS:
            check_type(name, getattr(self, name), SensorError)
        store(
            self, force_gain=check_number("force_gain", self.force_gain, 0.0, 1.0, "of the force")
        )
        store(self, delay=check_count("delay", self.delay, 0, MAX_DELAY, "control ticks"))

    def with_noise_of(self, other: SensorConfig, share: float) -> SensorConfig:
        """The same with a ``share`` of another configuration's noise on top (variances add)."""
        if share == 0.0:
            return self
        noisier = {}
        for name in ERROR_KINDS:
            own, added = getattr(self, name), share * getattr(other, name).noise
            noisier[name] = dataclasses.replace(own, noise=math.hypot(own.noise, added))
        return dataclasses.replace(self, **noisier)


ERROR_KINDS = (
    "joint_position", "joint_velocity", "tilt", "gyro", "force", "moment", "accelerometer",
)  # fmt: skip
"""The readings that have a :class:`SensorError`."""

STREAMS: Mapping[str, int] = MappingProxyType(
    {
        "joint_position": 0,
        "joint_velocity": 1,
        "tilt": 2,
        "gyro": 3,
        "force": 4,
        "moment": 5,
        "force_gain": 6,
        "accelerometer": 7,
    }
)
"""Each has a generator of its own, so that the errors of one kind do not depend on another's."""

_ENCODER_STEP = 2 * math.pi / 4096
"""The iCub's absolute joint encoders (AEA boards) resolve 12 bit per turn."""

SENSORS: Mapping[SensorName, SensorConfig] = MappingProxyType(
    {
        "ideal": SensorConfig(),
        "realistic": SensorConfig(
            # Standard deviation of rounding to one step; calibrated to 0.2 deg (assumption).
            joint_position=SensorError(noise=_ENCODER_STEP / math.sqrt(12), bias=0.0035),
            # Assumption: filtered differences of the encoder.
            joint_velocity=SensorError(noise=0.05),
            # Assumptions: an attitude filter good to 0.5 deg, a MEMS gyroscope.
            tilt=SensorError(noise=0.009, bias=0.009),
            gyro=SensorError(noise=0.05, bias=0.01, drift=0.001),
            # Assumptions: a calibrated MEMS accelerometer on a robot that vibrates. Data
            # sheets give less noise (Xsens MTi-300: 60 ug/sqrt(Hz), 0.006 m/s^2 in 100 Hz).
            accelerometer=SensorError(noise=0.05, bias=0.1),
            # Assumptions. Andrade Chavez, Traversaro and Pucci (Sensors 19(24):5521, 2019)
            # describe how the iCub's force/torque sensors lose their calibration once
            # mounted and drift with temperature.
            force=SensorError(noise=1.0, bias=10.0, drift=2.0),
            moment=SensorError(noise=0.05, bias=0.5, drift=0.1),
            force_gain=0.05,
            delay=1,
        ),
    }
)
"""Sensor errors by name."""


class Errors(Record):
    """One number for each channel of the sensors that may err.

    Attributes:
        joint_position, and all others: As in :class:`SensorConfig`; of the force and the moment
            those of the left foot first.
    """

    joint_position: PerJoint
    joint_velocity: PerJoint
    tilt: Vector
    gyro: Vector
    accelerometer: Vector
    force: Annotated[Array, (2, 3)]
    moment: Annotated[Array, (2, 3)]


class SensorErrors:
    """Draws the errors of an episode.

    Attributes:
        kinds: The readings that err.
        bias: Constant offset of each channel.
        drift: Its rate (1/s).
        present: The errors of the latest reading.
    """

    def __init__(self, config: SensorConfig, n_joints: int, seed: int) -> None:
        """Draw bias and drift.

        Args:
            config: How large the errors are.
            n_joints: How many joints there are.
            seed: Of all errors; those of one kind do not depend on another's.
        """
        sizes = {"n": n_joints}
        self.kinds = tuple(k for k in ERROR_KINDS if getattr(config, k) != SensorError())
        self.bias, self.drift, self.present = Errors(sizes), Errors(sizes), Errors(sizes)
        self._noise = np.zeros(AHEAD, self.bias.block.dtype)
        self._next = AHEAD
        self._sources: dict[str, tuple[float, np.random.Generator]] = {}
        for kind in self.kinds:
            error, rng = getattr(config, kind), np.random.default_rng([seed, STREAMS[kind]])
            for largest, offset in ((error.bias, self.bias), (error.drift, self.drift)):
                values = getattr(offset, kind)
                values[:] = largest * rng.uniform(-1.0, 1.0, values.shape)
            if error.noise > 0.0:
                self._sources[kind] = error.noise, rng

    def draw(self, time: float) -> Errors:
        """The errors of one reading, ``time`` (s) after the reset; the next call overwrites them."""
        if self._next == AHEAD:
            for kind, (deviation, rng) in self._sources.items():
                noise = self._noise[kind]
                noise[:] = deviation * rng.standard_normal(noise.shape)
            self._next = 0
        bias, drift = _channels(self.bias.block), _channels(self.drift.block)
        noise = _channels(self._noise[self._next : self._next + 1])
        _channels(self.present.block)[:] = bias + drift * time + noise
        self._next += 1
        return self.present


AHEAD = 50
"""Readings for which noise is drawn at a time; it is the same as if drawn one by one."""


def _channels(block: Block) -> Array:
    channels: Array = block.view(np.float64)
    return channels
