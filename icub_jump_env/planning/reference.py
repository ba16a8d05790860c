"""The set point of the launch in the world: a plan from where the robot stands, plus residual."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter

Array = NDArray[np.float64]


class Reference:
    """What the launch tracks.

    Attributes:
        setpoint: The set point in the world; its posture and momentum are the plan's.
        residual: The shaped residual that is part of its CoM.
    """

    def __init__(self, residual: ResidualFilter) -> None:
        self.residual = residual
        self.setpoint: Setpoint
        self._start = np.zeros(3)
        self._plan: JumpPlan

    def start(self, plan: JumpPlan, com: Array) -> None:
        """Begin to follow ``plan`` with the CoM at ``com`` ((3,) m)."""
        self._plan = plan
        self._start[:] = com
        self.residual.reset()
        planned = plan.sample(0.0)
        self.setpoint = dataclasses.replace(
            planned,
            com_position=np.zeros(3),
            com_velocity=np.zeros(3),
            com_acceleration=np.zeros(3),
        )
        self.update(0.0)

    def update(self, time: float) -> None:
        """Set the set point for ``time`` (s) after the start."""
        setpoint, residual, planned = self.setpoint, self.residual, self._plan.sample(time)
        np.add(self._start, residual.offset, out=setpoint.com_position)
        setpoint.com_position += planned.com_position
        np.add(residual.velocity, planned.com_velocity, out=setpoint.com_velocity)
        np.add(residual.acceleration, planned.com_acceleration, out=setpoint.com_acceleration)
