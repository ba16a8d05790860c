"""How the legs put the soles somewhere while the base is free: inverse kinematics by steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

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
        middle = np.array([robot.sole.center_x, 0.0, robot.sole.bottom])
        self._com = self._data.com[0]
        # Of each leg: ankle in the base, sole in the ankle, and Jacobian: the twist of its foot
        # where that passes the base origin, of its joints.
        self._feet = []
        for name, leg in zip(robot.sole_frames, (robot.left_leg, robot.right_leg), strict=True):
            frame = self._model.frames[self._model.getFrameId(name)]
            sole = pin.SE3(frame.placement.rotation, frame.placement.act(middle))
            J = self._data.J[:, 6 + leg.start : 6 + leg.stop]
            self._feet.append((self._data.oMi[frame.parentJoint], sole, J))

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
        steps, twist = np.empty((2, 6)), np.empty(6)
        for foot, (ankle, sole, J) in enumerate(self._feet):
            now = ankle * sole
            turn, position = pin.log3(orientation.dot(now.rotation.T)), now.translation
            twist[:3] = soles[foot] - position + self._com + pin.skew(position).dot(turn)
            twist[3:] = turn
            _, step, failed = dposv(J.T.dot(J) + self._regular, J.T.dot(twist))
            steps[foot] = 0.0 if failed else step
        legs = steps.reshape(12)
        np.minimum(np.maximum(legs, -_LARGEST_STEP, out=legs), _LARGEST_STEP, out=legs)
        legs += posture[self.joints]
        np.minimum(np.maximum(legs, self._lower, out=legs), self._upper, out=legs)
        return legs
