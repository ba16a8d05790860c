"""How the legs put the soles somewhere while the base is free: inverse kinematics by steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.robot.kinematics import build_pinocchio_model
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]

LIMIT_MARGIN = 0.02
"""What a step leaves of the position limits (rad)."""
_DAMPING = 1e-5
"""Keeps steps finite where a leg is stretched."""
_LARGEST_STEP = 0.15
"""Of one joint (rad)."""


class LegKinematics:
    """The soles relative to the CoM, as the legs move them.

    Attributes:
        joints: Where the joints of both legs are among all.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._model = build_pinocchio_model(robot)
        self._data = self._model.createData()
        self._q = pin.neutral(self._model)
        self.joints = slice(robot.left_leg.start, robot.right_leg.stop)
        self._lower = robot.lower_position[self.joints] + LIMIT_MARGIN
        self._upper = robot.upper_position[self.joints] - LIMIT_MARGIN
        self._regular = _DAMPING * np.eye(6)
        frames = [self._model.frames[self._model.getFrameId(name)] for name in robot.sole_frames]
        middle = np.array([robot.sole.center_x, 0.0, robot.sole.bottom])
        self._soles = [
            (self._data.oMi[f.parentJoint], f.placement.act(middle), f.placement.rotation.copy())
            for f in frames
        ]
        legs = slice(6 + self.joints.start, 6 + self.joints.stop)
        # (leg, twist of its foot where that passes the base origin, joint)
        self._J = self._data.J[:, legs].reshape(6, 2, 6).transpose(1, 0, 2)

    def __reduce__(self) -> tuple[type[LegKinematics], tuple[Robot]]:
        # The buffers are views of Pinocchio's; a step fills them anew.
        return LegKinematics, (self._robot,)

    def place(self, posture: Array) -> tuple[Array, Array]:
        """Where a posture ((n,) rad) has the soles.

        Returns:
            (2, 3) the middles of their undersides from the CoM (m), and (2, 3, 3) their
            orientations, base frame.
        """
        self._q[7:] = posture
        pin.jacobianCenterOfMass(self._model, self._data, self._q)
        com = self._data.com[0]
        positions = np.array([ankle.act(point) - com for ankle, point, _ in self._soles])
        return positions, np.array([ankle.rotation @ turn for ankle, _, turn in self._soles])

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
        now, orientations = self.place(posture)
        twists = np.empty((2, 6, 1))
        for foot in range(2):
            turn = pin.log3(orientation @ orientations[foot].T)
            shift = soles[foot] - now[foot] + pin.skew(now[foot] + self._data.com[0]) @ turn
            twists[foot, :3, 0], twists[foot, 3:, 0] = shift, turn
        J, J_T = self._J, self._J.transpose(0, 2, 1)
        step = np.linalg.solve(J_T @ J + self._regular, J_T @ twists).reshape(12)
        np.minimum(np.maximum(step, -_LARGEST_STEP, out=step), _LARGEST_STEP, out=step)
        step += posture[self.joints]
        legs: Array = np.minimum(np.maximum(step, self._lower, out=step), self._upper, out=step)
        return legs
