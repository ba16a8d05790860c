"""The set point of the launch in the world: a plan from where the robot stands, plus residual."""

from __future__ import annotations

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.records import Array, Block


class Reference:
    """What the launch tracks.

    Attributes:
        setpoint: The set point in the world; its posture is the plan's.
        residual: The shaped residual that is part of its CoM and momentum.
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
        self.setpoint = Setpoint.at_rest(plan.stance.posture)
        self.update(0.0)

    def update(self, time: float) -> None:
        """Set the set point for ``time`` (s) after the start."""
        planned = self._plan.sample(time)
        move(planned.block, self._start, self.residual.block, self.setpoint.block)


@compiled
def move(planned: Block, start: Array, residual: Block, setpoint: Block) -> None:
    """Begin a plan at ``start`` ((3,) m) and add a residual."""
    setpoint[0] = planned[0]
    moved, shift = setpoint[0], residual[0]
    for i in range(3):
        moved.com_position[i] += start[i] + shift.offset[i]
        moved.com_velocity[i] += shift.velocity[i]
        moved.com_acceleration[i] += shift.acceleration[i]
    for i in range(2):
        moved.angular_momentum[i] += shift.offset[3 + i]
        moved.angular_momentum_rate[i] += shift.velocity[3 + i]
