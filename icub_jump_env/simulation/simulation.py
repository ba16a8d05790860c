"""The robot in its world: commands in, readings out, the true state beside them."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.simulation.actuators.actuators import Actuators
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.disturbances import Disturbances
from icub_jump_env.simulation.ground_truth import GroundTruth
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import (
    Randomization,
    World,
    draw_disturbances,
    draw_world,
)
from icub_jump_env.simulation.sensor_models import SensorConfig
from icub_jump_env.simulation.sensors import Sensors
from icub_jump_env.simulation.variation import ModelVariation

Array = NDArray[np.float64]

SETTLING_TIME = 0.3
"""Time (s) that a reset lets the soles settle into the floor before the jump starts; ours."""


class Simulation:
    """Physics with actuators, sensors and whatever of it varies between episodes.

    Attributes:
        physics: The MuJoCo world.
        truth: Its true state.
        sensors: What the controllers may know of it.
        actuators: What turns their commands into torques.
        world: What was drawn for the present episode.
    """

    def __init__(
        self,
        physics: Physics,
        actuators: ActuatorConfig,
        sensors: SensorConfig,
        randomization: Randomization,
        command_delay: int,
    ) -> None:
        """Set up the simulation.

        Args:
            physics: The MuJoCo world.
            actuators: Models of the actuators.
            sensors: Errors of the sensors.
            randomization: What varies.
            command_delay: Control ticks until a command takes effect, beside those drawn.
        """
        self.physics = physics
        self.truth = GroundTruth(physics)
        self.sensors = Sensors(physics, sensors)
        self._actuator_config = actuators
        self._dt = float(physics.model.opt.timestep)
        nominal = np.ones(physics.robot.n_joints)
        self.actuators = Actuators(actuators, physics.robot, self._dt, nominal, nominal)
        self._randomization = randomization
        self._variation = ModelVariation(physics.model, physics.robot)
        self._command_delay = command_delay
        self._pending: deque[JointCommand] = deque()
        self._disturbances: Disturbances | None = None
        self.world: World

    def reset(
        self,
        rng: np.random.Generator,
        qpos: Array,
        torque: Array,
        launch_duration: float,
    ) -> None:
        """Draw a world and let the robot settle in it, at rest at time zero.

        Args:
            rng: Where all randomness comes from.
            qpos: (n + 7,) MuJoCo positions to start from.
            torque: (n,) joint torques that hold them (Nm).
            launch_duration: In which the push of the launch has to fit (s).
        """
        physics = self.physics
        robot, n_links = physics.robot, physics.model.nbody - 1
        world = draw_world(self._randomization, robot, n_links, rng)
        seed = int(rng.integers(2**63))
        self.world = world = draw_disturbances(self._randomization, world, seed)
        if self._randomization.varies:
            self._variation.apply(world, physics.model)
            self.actuators = Actuators(
                self._actuator_config, robot, self._dt, world.strength, world.joint_gain
            )
        self.sensors.reset(world, seed)
        physics.reset(qpos)
        self.actuators.reset(qpos[7:], torque)
        self._disturbances = None
        for _ in range(round(SETTLING_TIME / self._dt)):
            self.step()
        physics.start_from_rest()
        self._pending.clear()
        self._disturbances = Disturbances.of(physics, world, launch_duration)

    def drawn(self) -> dict[str, Any]:
        """What the reset drew: ``world`` and ``sensor_errors``, plain values."""
        return {"world": self.world.as_dict(), "sensor_errors": self.sensors.drawn()}

    def command(self, command: JointCommand) -> None:
        """Send a command on its way; call once per control tick."""
        delay = self._command_delay + self.world.delay
        if delay == 0:
            self.actuators.command(command)
            return
        self._pending.append(command)
        if len(self._pending) > delay:
            self.actuators.command(self._pending.popleft())

    def step(self) -> None:
        """Advance by one physics step."""
        physics = self.physics
        position = physics.joint_position
        if self.sensors.biased:
            position = position + self.sensors.encoder_bias
        actuators = self.actuators
        torque = actuators.torque(position, physics.joint_velocity)
        if self._disturbances is not None:
            self._disturbances.act()
        physics.step(torque, actuators.friction)

    def sense(self) -> Readings:
        """Take new readings; call once per control tick."""
        readings = self.sensors.read()
        self.actuators.torque_error[:] = self.sensors.torque_error
        return readings
