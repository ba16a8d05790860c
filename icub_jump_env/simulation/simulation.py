"""The robot in its world: commands in, readings out, the true state beside them."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.control.command import JointCommand
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.metrics.series import OUTCOMES, RUNNING, SeriesRecorder
from icub_jump_env.records import Block
from icub_jump_env.simulation.actuators.actuators import Actuators
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.disturbances import Awaited, Disturbances, comes
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
from icub_jump_env.simulation.stepping import (
    EVENT,
    after_step,
    before_step,
    settle,
    take_steps,
)
from icub_jump_env.simulation.variation import ModelVariation

Array = NDArray[np.float64]

SETTLING_TIME = 0.3
"""Time (s) that a reset lets the soles settle into the floor before the jump starts; ours."""


class Settled(NamedTuple):
    """A robot that has settled.

    Attributes:
        start: All that it depends on.
        state: MuJoCo's.
        drives: Block of the actuators.
    """

    start: bytes
    state: Array
    drives: Block


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
        compiled: bool,
    ) -> None:
        """Set up the simulation.

        Args:
            physics: The MuJoCo world.
            actuators: Models of the actuators.
            sensors: Errors of the sensors.
            randomization: What varies.
            command_delay: Control ticks until a command takes effect, beside those drawn.
            compiled: Whether the steps of a control tick are compiled.
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
        self._disturbances: Disturbances
        self._awaited = Awaited()
        self._compiled = compiled
        self._settled: Settled | None = None
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
        self._awaited = Awaited()
        self._settle()
        physics.start_from_rest()
        self._pending.clear()
        self._disturbances = Disturbances(physics, world, launch_duration)
        self._awaited = self._disturbances.awaited

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

    def run(self, steps: int, series: SeriesRecorder) -> str:
        """Take physics steps, no more than it takes to the end of the episode.

        Args:
            steps: How many.
            series: Watches and judges each.

        Returns:
            The outcome of the episode; ``running`` while it has none.
        """
        physics, noticed, reason = self.physics, False, RUNNING
        watching = self.truth.state.block, *series.blocks
        while steps > 0 and reason == RUNNING:
            taken, reason = self._take(steps, noticed, watching)
            steps -= taken
            noticed = reason == EVENT
            if noticed:
                self._disturbances.happen()
                series.rules.last_push = self._disturbances.last_push
                reason = RUNNING
        if physics.diverged:
            return "diverged"
        return OUTCOMES[reason]

    def _forces(self) -> tuple[Any, ...]:
        physics = self.physics
        return (
            physics.joint_position, physics.joint_velocity, self.sensors.encoder_bias,
            self.actuators.drives.block, physics.control, physics.joint_force,
            self._awaited.block, physics.chest_force,
        )  # fmt: skip

    def _take(self, steps: int, noticed: bool, watching: tuple[Any, ...]) -> tuple[int, int]:
        physics, sources, forces = self.physics, self.truth.sources, self._forces()
        if self._compiled:
            result = take_steps(
                *physics.addresses, physics.data.time, self._dt, steps, noticed, forces,
                physics.warnings, sources, *watching,
            )  # fmt: skip
            physics.note(result[0])
            return result
        if not noticed and comes(sources[0], self._awaited.block):
            return 0, EVENT
        time = physics.data.time
        before_step(time, *forces)
        physics.step()
        return 1, after_step(time, physics.warnings, sources, *watching)

    def _settle(self) -> None:
        """Let the robot settle, or take what came of it where all was the same."""
        physics, drives, forces = self.physics, self.actuators.drives.block, self._forces()
        steps = round(SETTLING_TIME / self._dt)
        if not self._compiled:
            for step in range(steps):
                before_step(step * self._dt, *forces)
                physics.step()
            return
        bias = self.sensors.encoder_bias
        start = (
            physics.parameters() + physics.state().tobytes() + drives.tobytes() + bias.tobytes()
        )
        if self._settled is None or self._settled.start != start:
            settle(*physics.addresses, self._dt, steps, forces)
            self._settled = Settled(start, physics.state(), drives.copy())
        else:
            physics.set_state(self._settled.state)
            drives[:] = self._settled.drives

    def sense(self) -> Readings:
        """Take new readings; call once per control tick."""
        readings = self.sensors.read()
        self.actuators.drives.torque_error[:] = self.sensors.torque_error
        return readings
