"""How the legs put the soles somewhere while the base is free: inverse kinematics by steps."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pinocchio as pin

from icub_jump_env.compiled import compiled
from icub_jump_env.linear_algebra import (
    add_cross,
    cholesky,
    multiply,
    rotate,
    solve,
    solve_transposed,
    turn_of,
)
from icub_jump_env.records import Array, Block, Record
from icub_jump_env.robot.kinematics import build_pinocchio_model
from icub_jump_env.robot.robot import Robot

LIMIT_MARGIN = 0.02
"""What a step leaves of the position limits (rad)."""
DAMPING = 1e-5
"""Keeps steps finite where a leg is stretched."""
LARGEST_STEP = 0.15
"""Of one joint (rad)."""


class Soles(Record):
    """What of a robot's legs and soles does not change, left before right.

    Attributes:
        ankle_R_sole: (2, 3, 3) orientations of the soles' frames.
        ankle_p_sole: (2, 3) middles of the soles' undersides (m).
        lower, upper: (12,) position limits of the legs' joints, less a margin (rad).
    """

    ankle_R_sole: Annotated[Array, (2, 3, 3)]
    ankle_p_sole: Annotated[Array, (2, 3)]
    lower: Annotated[Array, (12,)]
    upper: Annotated[Array, (12,)]


class LegKinematics:
    """The soles relative to the CoM, as the legs move them.

    Attributes:
        joints: Where the joints of both legs are among all.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._model = model = build_pinocchio_model(robot)
        self._data = data = model.createData()
        self._q = pin.neutral(model)
        self.joints = slice(robot.left_leg.start, robot.right_leg.stop)
        frames = [model.frames[model.getFrameId(name)] for name in robot.sole_frames]
        middle = np.array([robot.sole.center_x, 0.0, robot.sole.bottom])
        self._soles = Soles(
            ankle_R_sole=[frame.placement.rotation for frame in frames],
            ankle_p_sole=[frame.placement.act(middle) for frame in frames],
            lower=robot.lower_position[self.joints] + LIMIT_MARGIN,
            upper=robot.upper_position[self.joints] - LIMIT_MARGIN,
        )
        left, right = (data.oMi[frame.parentJoint] for frame in frames)
        self._buffers = (
            data.J, data.com[0],
            left.rotation, left.translation, right.rotation, right.translation, self._soles.block,
        )  # fmt: skip

    def __reduce__(self) -> tuple[type[LegKinematics], tuple[Robot]]:
        # The buffers are views of Pinocchio's; a step fills them anew.
        return LegKinematics, (self._robot,)

    def step(self, posture: Array, soles: Array, orientation: Array) -> Array:
        """One Gauss-Newton step from a posture towards wanted soles.

        What the legs do to the CoM is left to the next step: a step leaves about a fifth of
        the error.

        Args:
            posture: (n,) rad.
            soles: (2, 3) wanted middles of the undersides from the CoM, base frame (m).
            orientation: (3, 3) wanted orientation of both soles in the base.

        Returns:
            (12,) positions of the leg joints (rad), within their limits.
        """
        self._q[7:] = posture
        pin.jacobianCenterOfMass(self._model, self._data, self._q)
        legs = posture[self.joints].copy()
        step_legs(*self._buffers, soles, orientation, legs)
        return legs


@compiled
def step_legs(
    J: Array,
    base_p_com: Array,
    left_R: Array,
    left_p: Array,
    right_R: Array,
    right_p: Array,
    constants: Block,
    wanted: Array,
    orientation: Array,
    legs: Array,
) -> None:
    """The step of :meth:`LegKinematics.step`.

    Args:
        J: (6, n + 6) Jacobians of all joints, base axes.
        base_p_com: (3,) position of the CoM in the base (m).
        left_R: (3, 3) orientation of the left ankle, base axes.
        left_p: (3,) its position (m).
        right_R: Of the right ankle.
        right_p: Likewise.
        constants: Block of the :class:`Soles`.
        wanted: (2, 3) wanted middles of the undersides from the CoM, base frame (m).
        orientation: (3, 3) wanted orientation of both soles in the base.
        legs: (12,) positions of the leg joints (rad), which this moves.
    """
    c = constants[0]
    now, error, twist, turn = np.empty((3, 3)), np.empty((3, 3)), np.empty(6), np.empty(3)
    position, normal = np.empty(3), np.empty((6, 6))
    for foot in range(2):
        if foot == 0:
            multiply(left_R, c.ankle_R_sole[0], now)
            rotate(left_R, c.ankle_p_sole[0], position)
        else:
            multiply(right_R, c.ankle_R_sole[1], now)
            rotate(right_R, c.ankle_p_sole[1], position)
        ankle = left_p if foot == 0 else right_p
        multiply(orientation, now.T, error)
        turn_of(error, turn)
        for i in range(3):
            position[i] += ankle[i]
            twist[i] = wanted[foot, i] - position[i] + base_p_com[i]
            twist[3 + i] = turn[i]
        # The Jacobian's twist is that of the foot where it passes the base's origin.
        add_cross(position, turn, 1.0, twist[:3])
        step = np.zeros(6)
        for i in range(6):
            for k in range(6):
                step[i] += J[k, 6 + 6 * foot + i] * twist[k]
            for j in range(i, 6):
                normal[i, j] = DAMPING if i == j else 0.0
                for k in range(6):
                    normal[i, j] += J[k, 6 + 6 * foot + i] * J[k, 6 + 6 * foot + j]
        if not cholesky(normal, normal):
            continue
        solve_transposed(normal, step)
        solve(normal, step)
        for i in range(6):
            legs[6 * foot + i] += min(max(step[i], -LARGEST_STEP), LARGEST_STEP)
    for i in range(12):
        legs[i] = min(max(legs[i], c.lower[i]), c.upper[i])
