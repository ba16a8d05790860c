"""The simulated world: one iCub on a floor, stepped by MuJoCo."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.compiled import compiled
from icub_jump_env.robot.mujoco_model import build_model
from icub_jump_env.robot.robot import Robot

Array = NDArray[np.float64]

_MOVES = ("actuator_", "body_", "dof_", "eq_", "geom_", "jnt_", "qpos", "sensor_", "site_")
"""How fields of the model begin that say how it moves and what is measured."""
HUGE = 1e3
"""No position (m, rad) or velocity (m/s, rad/s) of a jumping robot comes near this."""


class Physics:
    """One iCub on a floor.

    The state is written in :meth:`reset`; after it forces enter as motor torques through
    ``data.ctrl``, and where the models have them as gear friction through
    ``data.qfrc_applied`` and as a push on the chest through ``data.xfrc_applied``. Of the
    :class:`icub_jump_env.simulation.disturbances.Disturbances`, which none has by default, a
    spin adds to ``data.qvel`` at lift-off, and another ground moves geometries of ``model``
    at the apex.

    Attributes:
        robot: The robot.
        model: The MuJoCo model.
        data: The MuJoCo data.
        joint_position: (n,) live view of the joint positions (rad).
        joint_velocity: (n,) live view of the joint velocities (rad/s).
        control: (n,) live view of the motor torques on the joint side (Nm), which MuJoCo clamps at
            the effort limits.
        joint_force: (n,) live view of other torques on the joints (Nm).
        chest_force: (3,) live view of the external force on the chest's CoM (N), world axes;
            it acts until it is changed.
        warnings: Live view of how often MuJoCo warned, by kind.
        addresses: Of MuJoCo's model and data, for compiled code.
        evaluated_time: Time (s) for which MuJoCo last evaluated forces, sensors and all
            that depends on the state: the beginning of the last step.
    """

    def __init__(
        self,
        robot: Robot,
        timestep: float,
        visuals: bool = False,
        self_collision: bool = False,
        blocks: bool = False,
    ) -> None:
        self.robot = robot
        self.model = build_model(robot, timestep, visuals, self_collision, blocks)
        self.data = mujoco.MjData(self.model)
        self._bind()

    def _bind(self) -> None:
        _silence_mujoco()
        data = self.data
        self.joint_position = data.qpos[7:]
        self.joint_velocity = data.qvel[6:]
        self._qpos, self._qvel, self.control = data.qpos, data.qvel, data.ctrl
        self.joint_force = data.qfrc_applied[6:]
        self.chest_force = data.xfrc_applied[self.model.body(self.robot.chest_link).id, :3]
        self.warnings = data.warning.number
        # MuJoCo names these for C code beside its bindings; see its issues 983 and 2564.
        self.addresses = self.model._address, data._address
        own = [name for name in dir(self.model) if name.startswith(_MOVES)]
        self._parameters = [getattr(self.model, name) for name in own]
        self._dt = float(self.model.opt.timestep)
        self._last_time = data.time
        self.evaluated_time = data.time

    def __getstate__(self) -> dict[str, Any]:
        # The rest are views, which a copy must take anew of its own data.
        return {
            "robot": self.robot,
            "model": self.model,
            "data": self.data,
            "last_time": self._last_time,
            "evaluated_time": self.evaluated_time,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.robot, self.model, self.data = state["robot"], state["model"], state["data"]
        self._bind()
        self._last_time = state["last_time"]
        self.evaluated_time = state["evaluated_time"]

    def reset(self, qpos: Array) -> None:
        """Put the robot at rest at MuJoCo positions ``qpos``, (n + 7,)."""
        mujoco.mj_resetData(self.model, self.data)
        self._qpos[:] = qpos
        mujoco.mj_forward(self.model, self.data)
        self._last_time = self.evaluated_time = 0.0

    def parameters(self) -> bytes:
        """The numbers of the model, but for its meshes: while they are the same, it moves alike."""
        options = self.model.opt
        others = [getattr(options, name) for name in dir(options) if name[0].islower()]
        return b"".join(np.asarray(value).tobytes() for value in [*self._parameters, *others])

    def state(self) -> Array:
        """All that the next step depends on beside the model."""
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION)
        state = np.empty(size)
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return state

    def set_state(self, state: Array) -> None:
        """Go on from a :meth:`state`."""
        mujoco.mj_setState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)

    def start_from_rest(self) -> None:
        """Stop all motion and set the time to zero, as the last part of a reset."""
        self._qvel[:] = 0.0
        self.data.time = self._last_time = self.evaluated_time = 0.0
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """Advance by one physics step."""
        mujoco.mj_step(self.model, self.data)
        self.note(1)

    def note(self, steps: int) -> None:
        """MuJoCo has taken some steps."""
        # As MuJoCo adds up its clock.
        for _ in range(steps):
            self.evaluated_time = self._last_time
            self._last_time += self._dt

    @property
    def diverged(self) -> bool:
        """Whether the simulation cannot be trusted any more.

        Its state is not finite or huge; or it was, which MuJoCo's warnings and a clock that ran
        back tell: MuJoCo resets itself then, after which everything is finite again.
        """
        if self.data.time != self._last_time:
            return True
        return not sane(self._qpos, self._qvel, self.warnings)


@compiled
def sane(qpos: Array, qvel: Array, warnings: Array) -> bool:
    """Whether a state is finite and small enough to compute with, and MuJoCo did not warn."""
    for values in (qpos, qvel):
        for value in values:
            if not abs(value) < HUGE:
                return False
    return not warnings.any()


def _silence_mujoco() -> None:
    """Keep MuJoCo from printing warnings and from writing them into the working folder.

    For the whole process, as MuJoCo has it. ``data.warning`` counts them all the same, and a
    callback set by ``mujoco.set_mju_user_warning`` is still called.
    """
    log = mujoco.MjLogConfig.get()
    log.logto_console = log.logto_file = False
    log.set()
