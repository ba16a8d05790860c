"""How far estimators are from the truth in a jump, by phase."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.estimation.estimator import Estimator
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.imu import CONTACT_GAIN, ImuEstimator, load_of, share_of
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.quantities import CM
from icub_jump_env.records import Block
from icub_jump_env.robot.icub import GRAVITY
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.mujoco_model import sole_geom

Array = NDArray[np.float64]

PHASES = ("launch", "last 30 ms", "flight", "landing", "after")
LAST, LANDING = 0.03, 0.3
"""Before take-off the launch's last part, after touch-down the landing (s)."""

QUANTITIES = (
    ("attitude", "deg", 2),
    ("angular momentum", "kg m^2/s", 2),
    ("CoM from soles", "cm", 2),
    ("CoM velocity", "m/s", 3),
)
"""Name, unit and decimals of what errors are computed of."""
ATTITUDE, VELOCITY = 0, 3
"""Which of them; the accelerometer has a part in the last one alone."""


class Motion(NamedTuple):
    """What is true, or believed, at one instant; world frame.

    Attributes:
        rotation: (3, 3) orientation of the base.
        angular_momentum: (3,) about the CoM (kg m^2/s).
        com: (3,) m.
        com_velocity: (3,) m/s.
        soles: (2, 3) middles of the undersides (m).
    """

    rotation: Array
    angular_momentum: Array
    com: Array
    com_velocity: Array
    soles: Array

    @classmethod
    def believed(cls, state: RobotState) -> Motion:
        """What an estimator says; views."""
        R, momentum = state.base_rotation, state.angular_momentum
        return cls(R, momentum, state.com, state.com_velocity, state.sole_position)

    def errors(self, truth: Motion) -> list[float]:
        """Of the :data:`QUANTITIES`, in their units."""
        offset = self.com - self.soles.mean(axis=0) - truth.com + truth.soles.mean(axis=0)
        up, true_up = self.rotation[2], truth.rotation[2]
        return [
            math.degrees(math.atan2(float(np.linalg.norm(np.cross(up, true_up))), up @ true_up)),
            float(np.linalg.norm(self.angular_momentum - truth.angular_momentum)),
            CM * float(np.linalg.norm(offset)),
            float(np.linalg.norm(self.com_velocity - truth.com_velocity)),
        ]


class Truth:
    """The present motion; the simulation itself keeps that of the last step's beginning."""

    def __init__(self, model: Any) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._base = model.body("root_link").id
        self._soles = [model.geom(sole_geom(side)).id for side in "lr"]

    def read(self, data: Any) -> Motion:
        """Of the MuJoCo data of an episode; copies."""
        model, own = self._model, self._data
        own.qpos[:], own.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(model, own)
        down = [
            model.geom_size[sole][2] * own.geom_xmat[sole].reshape(3, 3)[:, 2]
            for sole in self._soles
        ]
        return Motion(
            own.xmat[self._base].reshape(3, 3).copy(),
            own.sensor("angular_momentum").data.copy(),
            own.sensor("com").data.copy(),
            own.sensor("com_velocity").data.copy(),
            own.geom_xpos[self._soles] - down,
        )


class WithoutAccelerometer(ImuEstimator):
    """Believes the velocity of the feet as far as they carry load, else that the CoM falls."""

    def _predict(self, *blocks: Block) -> None:
        memory, kinematics, state = self._memory, self._kinematics, self._state
        first = memory.readings == 0.0
        position, before = memory.base_position.copy(), memory.base_velocity.copy()
        super()._predict(*blocks)
        if first:
            return
        relative = kinematics.A_base[:3, 3:] @ memory.base_twist[3:]
        relative += kinematics.A_joints[:3] @ state.joint_velocity
        falling = state.com_velocity + (GRAVITY * memory.dt) * state.gravity
        memory.base_velocity[:] = falling - state.base_rotation @ relative / kinematics.mass
        memory.base_position[:] = position + memory.dt / 2 * (before + memory.base_velocity)

    def _stand(self, *blocks: Block) -> None:
        memory = self._memory
        before = memory.base_velocity.copy()
        super()._stand(*blocks)
        load = load_of(memory.block[0], float(self._state.foot_force.sum()), 1.0)
        if load > 0.0:
            # Nothing to wait for: the correction comes whole.
            taken = share_of(memory.block[0], CONTACT_GAIN * load)
            memory.base_velocity[:] = before + load / taken * (memory.base_velocity - before)


class InertialInTheAir(ImuEstimator):
    """Takes no reading of gravity in the air, where a real IMU has none either."""

    def _correct_attitude(self, *blocks: Block) -> None:
        if self._memory.airborne:
            kinematics, readings, *others = blocks
            readings = readings.copy()
            down = self._state.base_rotation.T @ self._state.gravity
            readings["gravity"][0] = self._memory.base_R_imu.T @ down
            blocks = kinematics, readings, *others
        super()._correct_attitude(*blocks)


ESTIMATORS: dict[str, Callable[[FeetFixedKinematics, float], Estimator]] = {
    "feet_fixed": lambda kinematics, dt: FeetFixedEstimator(kinematics),
    "imu": ImuEstimator,
    "without accelerometer": WithoutAccelerometer,
    "inertial in the air": InertialInTheAir,
}


class WatchedEnv(ICubJumpEnv):
    """A jump that tells of every control tick.

    Attributes:
        watch: Called with the readings of each.
    """

    watch: Callable[[Readings], None]

    def _sense(self) -> None:
        super()._sense()
        self.watch(self._simulation.sensors.readings)


class Comparison:
    """All estimators beside each other in the jumps of one configuration."""

    def __init__(self, config: JumpConfig) -> None:
        self._env = WatchedEnv(**vars(config))
        self._env.watch = self._look
        self._truth = Truth(self._env.model)
        self._estimators = [
            make(FeetFixedKinematics(config.robot_value), config.control_dt)
            for make in ESTIMATORS.values()
        ]
        self._times: list[float] = []
        self._errors: list[list[list[float]]] = []

    def _look(self, readings: Readings) -> None:
        truth = self._truth.read(self._env.data)
        self._times.append(self._env.data.time)
        self._errors.append(
            [
                Motion.believed(estimator.estimate(readings)).errors(truth)
                for estimator in self._estimators
            ]
        )

    def jump(self, seed: int) -> Array:
        """(phases, estimators, quantities) root-mean-square errors; NaN of a phase not reached."""
        for estimator in self._estimators:
            estimator.reset()
        self._times.clear()
        self._errors.clear()
        self._env.reset(seed=seed)
        terminated = False
        while not terminated:
            _, _, terminated, _, info = self._env.step(np.zeros(3, np.float32))
        jump = info["jump"]
        phases = phases_of(np.array(self._times), jump["takeoff_time"], jump["flight_time"])
        squares = np.array(self._errors) ** 2
        return np.array(
            [
                np.sqrt(squares[phases == k].mean(axis=0))
                if (phases == k).any()
                else np.full(squares.shape[1:], math.nan)
                for k in range(len(PHASES))
            ]
        )


def phases_of(times: Array, takeoff: float, flight: float) -> NDArray[np.int64]:
    """Which of the :data:`PHASES` each time (s) is in.

    Args:
        times: (k,) since the start.
        takeoff: When contact was lost; NaN if it never was.
        flight: How long the flight was; 0 if the robot never came down.
    """
    touchdown = takeoff + flight if flight > 0.0 else math.inf
    begins = [takeoff - LAST, takeoff, touchdown, touchdown + LANDING]
    # A time is not beyond NaN.
    return sum(
        (np.asarray(times >= begin, np.int64) for begin in begins), np.zeros(len(times), int)
    )
