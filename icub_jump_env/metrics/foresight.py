"""Whether a robot that has touched down will stand, known before it has stood long enough."""

from __future__ import annotations

import math

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Block
from icub_jump_env.robot.icub import GRAVITY

EARLIEST = 0.2
"""Nothing is foreseen before this time after touch-down (s)."""
CALM_TIME = 0.25
"""A robot that has been calm for this long will stand (s)."""
CALM_POINT = 0.035
"""Calm: the capture point is this close to the middle of the soles, forward and left (m),"""
CALM_SPEED, CALM_MOMENTUM = 0.1, 0.45
"""CoM (m/s) and angular momentum about it (kg m^2/s) are slower,"""
CALM_LEAN, CALM_LATERAL_LEAN = math.radians(24.0), math.radians(8.0)
"""and the chest leans less, forward or back, and sideways (rad)."""
LOST, LOST_LATERAL = 0.18, 0.14
"""A robot whose capture point is farther from the middle of the soles will fall (m),"""
FALL_TIME = 0.8
"""and will have fallen after this time (s)."""


@compiled
def capture_point(state: Block) -> tuple[float, float]:
    """Of an inverted pendulum, forward and left of the middle of the soles, world axes (m)."""
    s = state
    time = math.sqrt(max(s.com[2], 0.1) / GRAVITY)
    left, right = s.sole_position[0], s.sole_position[1]
    forward = s.com[0] + s.com_velocity[0] * time - (left[0] + right[0]) / 2.0
    sideways = s.com[1] + s.com_velocity[1] * time - (left[1] + right[1]) / 2.0
    return forward, sideways


@compiled
def is_calm(state: Block, forward: float, sideways: float) -> bool:
    """Whether a robot with this capture point (m) is calm."""
    s = state
    up = s.chest_up
    v, H = s.com_velocity, s.angular_momentum
    calm: bool = (
        abs(forward) < CALM_POINT
        and abs(sideways) < CALM_POINT
        and v[0] ** 2 + v[1] ** 2 + v[2] ** 2 < CALM_SPEED**2
        and H[0] ** 2 + H[1] ** 2 < CALM_MOMENTUM**2
        and abs(math.atan2(up[0], up[2])) < CALM_LEAN
        and abs(math.atan2(up[1], up[2])) < CALM_LATERAL_LEAN
    )
    return calm


@compiled
def foresee(state: Block, time: float, jump: Block) -> int:
    """What will become of a robot on the ground.

    Args:
        state: Element of the block of the :class:`icub_jump_env.metrics.state.TrueState`.
        time: Since the start of the jump (s).
        jump: Element of the block of the :class:`icub_jump_env.metrics.recorder.JumpRecord`;
            this keeps the latest time at which the robot was not calm.

    Returns:
        1 if it will stand, -1 if it will fall before it has stood long enough, 0 if that is not
        known yet.
    """
    forward, sideways = capture_point(state)
    if jump.flying or not is_calm(state, forward, sideways):
        jump.restless = time
    # Not so of a robot that has not touched down, whose time is NaN.
    if jump.flying or not time - jump.touchdown_time >= EARLIEST - 1e-9:
        return 0
    lost = abs(forward) > LOST or abs(sideways) > LOST_LATERAL
    if lost and time - jump.touchdown_time + FALL_TIME <= jump.rest:
        return -1
    return 1 if time - jump.restless >= CALM_TIME - 1e-9 else 0
