"""Low-level torque control: from the torque a controller asks for to the motor's torque."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.checks import check_choice, check_number, store

Array = NDArray[np.float64]


class TorqueLoop(Protocol):
    """Low-level torque controllers of all joints."""

    def reset(self, torque: Array) -> None:
        """Start from (n,) joint torques (Nm) in balance."""
        ...

    def motor_torque(self, desired: Array, measured: Array, friction: Array) -> Array:
        """Advance by one physics step.

        Args:
            desired: (n,) joint torques asked for (Nm).
            measured: (n,) joint torques measured (Nm); the loop may keep the array.
            friction: (n,) joint friction (Nm), for loops that compensate it by model.

        Returns:
            (n,) motor torques on the joint side (Nm); a buffer which the caller clips in
            place, so that a loop with a state cannot wind up.
        """
        ...


@dataclass(frozen=True)
class IdealTorque:
    """The motor gives the torque asked for at once."""

    kind: Literal["ideal"] = "ideal"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("ideal",))

    def make(self, dt: float, n_joints: int) -> TorqueLoop:
        """The loops of ``n_joints`` joints at a physics step of ``dt`` (s)."""
        return _Ideal(n_joints)


@dataclass(frozen=True)
class TorqueFeedback:
    """Feedback of the measured joint torque, as on the paper's robot.

    An integrator on the torque error, d tau_m / dt = 2 pi f (tau_d - tau_measured). It
    rejects friction within its bandwidth, and follows every error of the measurement.

    Attributes:
        bandwidth: Of the closed loop, f (Hz). Assumption; the paper says that its loops
            "were tuned for less dynamic tasks".
        delay: Age of the measurement (s). Assumption. The loop is stable while its product
            with the bandwidth is below 1/4, with half a physics step added to the delay.
        kind: Name of this model.

    Raises:
        ConfigError: If a value is out of range.
    """

    bandwidth: float = 20.0
    delay: float = 0.002
    kind: Literal["feedback"] = "feedback"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("feedback",))
        store(self, bandwidth=check_number("bandwidth", self.bandwidth, 0.1, 1000.0, "Hz"))
        store(self, delay=check_number("delay", self.delay, 0.0, 0.1, "s"))

    def make(self, dt: float, n_joints: int) -> TorqueLoop:
        """The loops of ``n_joints`` joints at a physics step of ``dt`` (s)."""
        return _Feedback(self, dt, n_joints)


@dataclass(frozen=True)
class CurrentControl:
    """Control of the motor current, the paper's future work: no torque measurement.

    A first-order lag. Fast and free of measurement errors, but it does not see what the
    gears lose: friction is compensated by a model as far as that is right, and the torque
    is only as exact as the torque constant.

    Attributes:
        bandwidth: Of the current loop (Hz). Assumption.
        friction_compensation: Share of the friction that the model compensates.
            Assumption.
        torque_constant: True torque constant over the one assumed. Assumption.
        kind: Name of this model.

    Raises:
        ConfigError: If a value is out of range.
    """

    bandwidth: float = 200.0
    friction_compensation: float = 0.7
    torque_constant: float = 0.97
    kind: Literal["current"] = "current"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("current",))
        store(self, bandwidth=check_number("bandwidth", self.bandwidth, 0.1, 1e4, "Hz"))
        store(
            self,
            friction_compensation=check_number(
                "friction_compensation", self.friction_compensation, 0.0, 1.5, "of the friction"
            ),
        )
        store(
            self,
            torque_constant=check_number(
                "torque_constant", self.torque_constant, 0.5, 1.5, "of the assumed one"
            ),
        )

    def make(self, dt: float, n_joints: int) -> TorqueLoop:
        """The loops of ``n_joints`` joints at a physics step of ``dt`` (s)."""
        return _Current(self, dt, n_joints)


class _Ideal:
    def __init__(self, n_joints: int) -> None:
        self._torque = np.zeros(n_joints)

    def reset(self, torque: Array) -> None:
        self._torque[:] = torque

    def motor_torque(self, desired: Array, measured: Array, friction: Array) -> Array:
        self._torque[:] = desired
        return self._torque


class _Feedback:
    def __init__(self, config: TorqueFeedback, dt: float, n_joints: int) -> None:
        self._gain = -math.expm1(-2 * math.pi * config.bandwidth * dt)
        self._torque = np.zeros(n_joints)
        self._measured: deque[Array] = deque(maxlen=1 + round(config.delay / dt))

    def reset(self, torque: Array) -> None:
        self._torque[:] = torque
        self._measured.extend(torque.copy() for _ in range(self._measured.maxlen or 0))

    def motor_torque(self, desired: Array, measured: Array, friction: Array) -> Array:
        self._measured.append(measured)
        self._torque += self._gain * (desired - self._measured[0])
        return self._torque


class _Current:
    def __init__(self, config: CurrentControl, dt: float, n_joints: int) -> None:
        self._share = -math.expm1(-2 * math.pi * config.bandwidth * dt)
        self._compensation = config.friction_compensation
        self._torque_constant = config.torque_constant
        self._torque = np.zeros(n_joints)

    def reset(self, torque: Array) -> None:
        self._torque[:] = torque

    def motor_torque(self, desired: Array, measured: Array, friction: Array) -> Array:
        asked = self._torque_constant * (desired + self._compensation * friction)
        self._torque += self._share * (asked - self._torque)
        return self._torque
