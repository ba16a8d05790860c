"""Limits of the joints: (3e) in velocities, (6e) in accelerations and torques."""

from __future__ import annotations

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block


@compiled
def velocity_limits(
    limits: Block, state: Block, horizon: float, margin: float, lower: Array, upper: Array
) -> None:
    """s_dot^- <= s_dot <= s_dot^+ and s^- <= s + T s_dot <= s^+, eq. (3e).

    The paper takes one control period for the horizon T, in which no joint can stop.

    Args:
        limits: Of the robot's joints.
        state: The believed state.
        horizon: T (s).
        margin: Share of the speed limits that may be used.
        lower: (n,) bounds of the joint velocities.
        upper: (n,)
    """
    for j in range(limits.speed.shape[0]):
        fastest, s = margin * limits.speed[j], state.joint_position[j]
        lower[j] = max(min((limits.lower[j] - s) / horizon, fastest), -fastest)
        upper[j] = max(min((limits.upper[j] - s) / horizon, fastest), -fastest)


@compiled
def acceleration_limits(
    limits: Block,
    state: Block,
    speed_horizon: float,
    position_horizon: float,
    lower: Array,
    upper: Array,
) -> None:
    """s_dot^- <= s_dot <= s_dot^+, s^- <= s <= s^+ after a horizon each, eq. (6e).

    At the decided s_ddot the speed after its horizon, and s + T s_dot + T^2/2 s_ddot, are
    within their limits; where both cannot be, the speed is.

    Args:
        limits: Of the robot's joints.
        state: The believed state.
        speed_horizon: s.
        position_horizon: T (s).
        lower: (n,) bounds of the joint accelerations.
        upper: (n,)
    """
    per_acceleration = 2.0 / position_horizon**2
    for j in range(limits.speed.shape[0]):
        rate = state.joint_velocity[j]
        drift = state.joint_position[j] + position_horizon * rate
        slowest = (-limits.speed[j] - rate) / speed_horizon
        fastest = (limits.speed[j] - rate) / speed_horizon
        lower[j] = min(max((limits.lower[j] - drift) * per_acceleration, slowest), fastest)
        upper[j] = min(max((limits.upper[j] - drift) * per_acceleration, slowest), fastest)


@compiled
def torque_limits(limits: Block, dynamics: Block, rows: Array, lower: Array, upper: Array) -> None:
    """tau^- <= tau <= tau^+, eq. (6e).

    Args:
        limits: Of the robot's joints.
        dynamics: Equations of motion.
        rows: (n, n + 12) map from the unknowns to tau, without its bias.
        lower: (n,) bounds of these rows.
        upper: (n,)
    """
    for i in range(limits.torque.shape[0]):
        lower[i] = -limits.torque[i] - dynamics.torque_bias[i]
        upper[i] = limits.torque[i] - dynamics.torque_bias[i]
        for j in range(rows.shape[1]):
            rows[i, j] = dynamics.torque_rows[i, j]
