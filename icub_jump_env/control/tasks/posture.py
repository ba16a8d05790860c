"""The posture task, first term of (3a) and (6a)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.plan import Setpoint

Array = NDArray[np.float64]


class PostureVelocity:
    """1/2 ||s_dot - s_dot*||^2_Lambda with s_dot* = s_dot_d - K_p (s - s_d), eq. (3a)."""

    def __init__(self, gain: float, weight: Array) -> None:
        """Set up the task.

        Args:
            gain: K_p (1/s).
            weight: (n,) diagonal of Lambda.
        """
        self.diagonal = weight
        self._pull = weight * gain

    def subtract(self, state: RobotState, setpoint: Setpoint, gradient: Array) -> None:
        """Subtract Lambda s_dot* from the gradient."""
        gradient += self._pull * state.joint_position
        gradient -= self._pull * setpoint.posture
        gradient -= self.diagonal * setpoint.posture_velocity


class PostureAcceleration:
    """1/2 ||s_ddot - s_ddot*||^2_Lambda, eq. (6a).

    s_ddot* = s_ddot_d - K_d (s_dot - s_dot_d) - K_p (s - s_d); the paper prints + K_d s_dot,
    which would feed the velocity back with the wrong sign.
    """

    def __init__(self, stiffness: float, damping: float, weight: Array) -> None:
        """Set up the task.

        Args:
            stiffness: K_p (1/s^2).
            damping: K_d (1/s).
            weight: (n,) diagonal of Lambda.
        """
        self.diagonal, self._stiffness, self._damping = weight, stiffness, damping

    def subtract(self, state: RobotState, setpoint: Setpoint, gradient: Array) -> None:
        """Subtract Lambda s_ddot* from the gradient."""
        wanted = setpoint.posture - state.joint_position
        wanted *= self._stiffness
        error = state.joint_velocity - setpoint.posture_velocity
        error *= self._damping
        wanted -= error
        wanted += setpoint.posture_acceleration
        wanted *= self.diagonal
        gradient -= wanted
