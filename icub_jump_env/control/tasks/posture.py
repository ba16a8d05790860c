"""The posture task, first term of (3a) and (6a): a cost on the unknowns themselves."""

from __future__ import annotations

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block


@compiled
def posture_velocity(
    state: Block, setpoint: Block, gain: float, weight: Array, gradient: Array
) -> None:
    """1/2 ||s_dot - s_dot*||^2_Lambda with s_dot* = s_dot_d - K_p (s - s_d), eq. (3a).

    Args:
        state: The believed state.
        setpoint: What to track.
        gain: K_p (1/s).
        weight: (n,) diagonal of Lambda, which the Hessian has already.
        gradient: (n,) from which this subtracts Lambda s_dot*.
    """
    for j in range(weight.shape[0]):
        error = state.joint_position[j] - setpoint.posture[j]
        gradient[j] -= weight[j] * (setpoint.posture_velocity[j] - gain * error)


@compiled
def posture_acceleration(
    state: Block,
    setpoint: Block,
    stiffness: float,
    damping: float,
    weight: Array,
    gradient: Array,
) -> None:
    """1/2 ||s_ddot - s_ddot*||^2_Lambda, eq. (6a).

    s_ddot* = s_ddot_d - K_d (s_dot - s_dot_d) - K_p (s - s_d); the paper prints + K_d s_dot,
    which would feed the velocity back with the wrong sign.

    Args:
        state: The believed state.
        setpoint: What to track.
        stiffness: K_p (1/s^2).
        damping: K_d (1/s).
        weight: (n,) diagonal of Lambda, which the Hessian has already.
        gradient: (n,) from which this subtracts Lambda s_ddot*.
    """
    for j in range(weight.shape[0]):
        error = state.joint_position[j] - setpoint.posture[j]
        rate = state.joint_velocity[j] - setpoint.posture_velocity[j]
        wanted = setpoint.posture_acceleration[j] - damping * rate - stiffness * error
        gradient[j] -= weight[j] * wanted
