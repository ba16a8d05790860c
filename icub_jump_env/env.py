"""The Gymnasium environment: reset and step, orchestration only."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from icub_jump_env.checks import check_action, check_seed
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.jump import REST, JumpController
from icub_jump_env.control.phases import Phase
from icub_jump_env.control.qp.problem import IDLE, worse
from icub_jump_env.estimation.estimator import Estimator
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.imu import ImuEstimator
from icub_jump_env.estimation.readings import LOADED
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.metrics.series import SeriesRecorder
from icub_jump_env.observation import OBSERVATION_LIMIT, Memory
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.planning.residual import COM_AXES
from icub_jump_env.reward import reward_terms
from icub_jump_env.robot.collision import TOLERANCE
from icub_jump_env.robot.frames import mujoco_qpos
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.limits import JointLimits
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.rendering import make_renderer
from icub_jump_env.simulation.self_collision import SelfCollision
from icub_jump_env.simulation.simulation import Simulation
from icub_jump_env.snapshot import Snapshot

LOOK_PERIOD = 0.01
"""How often links are looked at that may be in each other (s)."""


class ICubJumpEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """The iCub jumps from a crouch; an agent may shift the set point meanwhile.

    ## Description
    The controller of Bergonti, Fiorio and Pucci ("Torque and velocity controllers to perform jumps
    with a humanoid robot") launches the robot along a CoM trajectory scaled to the commanded height,
    retracts the feet in flight and holds a posture to land: v0. In v1 the launch follows whole-body
    plans, an IMU says where the robot is in the air, and feedback places the feet and catches the
    landing. The baseline needs no agent: action zero is what it does, bit for bit.

    ## Action space
    ``Box(-1, 1, (n,), float32)``: target offset of the set point along each of ``residual_axes`` in
    units of ``residual_scale``, world frame; by default the CoM forward, to the left and up. A
    critically damped filter turns it into a consistent offset, velocity and acceleration. It acts in the
    launching phase, or in all (``residual_phases``). One step lasts ``dt``, by default 0.01 s.

    ## Observation space
    ``Box(-10, 10, (layout.size,), float32)``: sensor readings, estimates made of them, the
    command and the phase; entry by entry in :mod:`icub_jump_env.observation` and
    docs/environment.md. No privileged state. Times are those of the present jump.

    ## Rewards
    The sum of the ``reward_*`` entries of ``info``, see
    :func:`icub_jump_env.reward.reward_terms`.

    ## Starting state
    At rest in the plan's crouch, soles flat on the floor, the world origin on the floor midway between
    the feet. World +x is where the robot faces, +y left, +z up; positive pitch about +y.

    ## Episode end
    With ``jumps`` above 1 the robot stands, crouches and jumps again, see docs/environment.md.
    Terminates on a fall (anything but the soles touches the floor, or the chest tilts
    more than 60 deg), without take-off by T + 0.5 s, without the next jump 3 s after a touch-down,
    ``stand_time`` after the last touch-down, or when the simulation diverges. ``info["outcome"]``
    says which; with ``early_end`` it may be foreseen. The TimeLimit of the registration only guards.

    ## Info
    At reset, what was drawn: ``world`` (:class:`icub_jump_env.simulation.randomization.World`)
    and ``sensor_errors`` (bias and drift by kind of reading, and the force gain).
    Every step: ``jump`` (dict of :class:`icub_jump_env.metrics.jump.JumpMetrics`, final
    at the end; of several jumps the present one), ``is_success`` (of all), with several jumps
    ``jumps`` and ``series``, ``outcome``, ``phase``, ``time``, ``diverged``, ``jump_height``,
    ``solver_status``, ``solver_primal_residual``, ``solver_dual_residual``, ``solver_gap`` (of the
    step's worst control tick) and, from ``step``, the reward terms.

    ## Arguments
    The fields of :class:`icub_jump_env.config.JumpConfig` and the
    :class:`icub_jump_env.shortcuts.Shortcuts` for fields inside its groups. ``reset(options=
    {"jump_height": 0.05})`` overrides the command for one episode, ``{"jump_heights": [...]}`` that
    of each jump.

    ## Version history
    * v1: the same with other defaults: ``planner="whole_body"``, ``estimator="imu"``,
      ``lean_correction=True``, ``flight="feedback"``, ``landing="feedback"`` (:data:`icub_jump_env.versions.VERSIONS`).
    * v0: the paper's jump. It stays as it is, whatever Gymnasium says of newer ones.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (declared so by Gymnasium)
        "render_modes": ["rgb_array", "human"],
        "render_fps": 100,
    }
    _engine: type[Physics] = Physics

    def __init__(self, **config: Any) -> None:
        """Build the world and the controllers.

        Args:
            config: Fields of :class:`icub_jump_env.config.JumpConfig`, and
                :class:`icub_jump_env.shortcuts.Shortcuts`.

        Raises:
            UnknownFieldError: If there is no such field; a ``TypeError``.
            ConfigError: If a field is out of range.
        """
        self.config = JumpConfig.of(**config)
        self.render_mode = self.config.rendering.mode
        self.metadata = {**self.metadata, "render_fps": round(self.config.agent_frequency)}
        self.layout = self.config.layout
        limit = OBSERVATION_LIMIT
        self.observation_space = spaces.Box(-limit, limit, (self.layout.size,), np.float32)
        cfg, self.robot = self.config, self.config.robot_value
        self.action_space = spaces.Box(-1.0, 1.0, (len(cfg.residual.axes),), np.float32)
        self._simulation = Simulation(
            self._engine(
                self.robot,
                cfg.timestep,
                visuals=self.render_mode is not None,
                self_collision=cfg.self_collision,
                blocks=cfg.randomization_config.blocks,
            ),
            cfg.actuator_config,
            cfg.sensor_config,
            cfg.randomization_config,
            cfg.command_delay,
            compiled=cfg.physics_loop == "compiled",
        )
        kinematics = FeetFixedKinematics(self.robot)
        self._estimator: Estimator = FeetFixedEstimator(kinematics)
        if cfg.estimator == "imu":
            self._estimator = ImuEstimator(kinematics, cfg.control_dt)
        self._series = SeriesRecorder(cfg.jumps, JointLimits.of(self.robot), cfg.success)
        self._recorder = self._series.present
        self._self_collision = SelfCollision(self.robot)
        # Plans are made while the estimator uses its model, too.
        self._planner = cfg.make_planner(FeetFixedKinematics(self.robot))
        self._controller = JumpController(
            cfg.controller_config, cfg.residual, kinematics, cfg.lean_correction,
            cfg.flight, cfg.landing,
        )  # fmt: skip
        self._moves = cfg.residual.matrix
        self._of_momentum = self._moves[len(COM_AXES) :].any(axis=0)
        self._state: RobotState
        self._start_com = np.zeros(3)
        self._heights: tuple[float, ...] = ()
        self._outcome = "not reset"
        self._report = IDLE
        self._observation = np.zeros(self.layout.size, np.float32)
        self._memory = Memory(cfg.agent_frequency)
        self._renderer = make_renderer(self._simulation.physics, self.config.rendering)

    @property
    def model(self) -> Any:
        """The ``mujoco.MjModel``."""
        return self._simulation.physics.model

    @property
    def data(self) -> Any:
        """The ``mujoco.MjData``."""
        return self._simulation.physics.data

    @property
    def dt(self) -> float:
        """Duration of one step (s)."""
        return 1.0 / self.config.agent_frequency

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode at rest in the crouch.

        Args:
            seed: Seed of the environment's generator.
            options: ``{"jump_height": float}`` overrides the command (m) for this
                episode, ``{"jump_heights": [...]}`` that of each jump.

        Returns:
            Observation and info.

        Raises:
            ConfigError: If the seed or an option is unknown or out of range.
        """
        episode, heights = self.config.with_options(options)
        super().reset(seed=check_seed(seed))
        self._heights = heights or episode.draw_heights(self.np_random)
        plan = self._planner.plan(self._heights[0])
        simulation, stance = self._simulation, plan.stance
        qpos = mujoco_qpos(stance.configuration)
        simulation.reset(self.np_random, qpos, stance.torque, plan.duration)
        self._series.reset()
        self._begin_jump(plan)
        self._next_look = 0.0
        self._outcome = "running"
        self._report = IDLE
        self._memory.forget()
        self._observe()
        if self.render_mode == "human":
            self.render()
        return self._observation.copy(), self._info() | self._simulation.drawn()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance by ``dt``; less if the episode ends within.

        Args:
            action: One entry for each of ``residual_axes``, in [-1, 1]; what lies beyond is clipped.

        Returns:
            Observation, reward, terminated, truncated (always False) and info.

        Raises:
            ActionError: If the action is misshapen or not finite.
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        if self._outcome == "not reset":
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        action64 = check_action(action, len(self.config.residual.axes))
        if not self._controller.residual_acts(self._simulation.physics.data.time):
            action64[:] = 0.0  # has no effect and costs nothing
        elif not self._controller.launching:
            action64[self._of_momentum] = 0.0
        target = self._moves @ action64
        self._report = IDLE
        already_over, before = self._outcome != "running", self._series.begun
        if self._simulation.physics.diverged:
            self._outcome = "diverged"
        for _ in range(self.config.controls_per_step):
            if self._outcome == "running":
                self._control_tick(target)
        terminated = self._outcome != "running"
        if self._outcome != "diverged":
            self._observe()
        ended = (self._series.jumps if terminated else self._series.ended)[before - 1 :]
        terms = reward_terms([] if already_over else ended, action64, self.config.reward)
        if self.render_mode == "human":
            self.render()
        reward = sum(terms.values())
        return self._observation.copy(), reward, terminated, False, self._info() | terms

    def render(self) -> Any:
        """A picture, (height, width, 3) uint8, in mode ``rgb_array``; else None."""
        if self._renderer is None:
            gymnasium.logger.warn("render() needs render_mode='rgb_array' or 'human' in make().")
            return None
        return self._renderer.render()

    def snapshot(self) -> Snapshot:
        """True state, reference and command at the present instant, for logs and figures."""
        truth, drives = self._simulation.truth.read(), self._simulation.actuators.drives
        controller, readings = self._controller, self._simulation.sensors.readings
        reference = np.full(3, np.nan)
        if controller.launching:
            reference = controller.reference.setpoint.com_position
        return Snapshot(
            time=truth.time,
            phase=controller.phases.phase.name.lower(),
            joint_position=truth.joint_position.copy(),
            joint_velocity=truth.joint_velocity.copy(),
            encoder_position=readings.joint_position.copy(),
            encoder_velocity=readings.joint_velocity.copy(),
            joint_velocity_command=drives.velocity_command.copy(),
            joint_torque=truth.joint_torque.copy(),
            joint_torque_command=drives.torque_command.copy(),
            com=truth.com.copy(),
            com_velocity=truth.com_velocity.copy(),
            angular_momentum=truth.angular_momentum.copy(),
            com_estimate=self._state.com.copy(),
            com_reference=reference.copy(),
            base_pitch=truth.base_pitch,
            ground_force=truth.ground_force,
        )

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        # A renderer holds a graphics context; a copy opens its own.
        return self.__dict__ | {"_renderer": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # The believed state is made of views of the model, which a copy fills anew.
        self._state = self._estimator.refresh(self._simulation.sensors.readings)
        self._renderer = make_renderer(self._simulation.physics, self.config.rendering)

    def _control_tick(self, residual_target: NDArray[np.float64]) -> None:
        simulation = self._simulation
        physics = simulation.physics
        tick = self._controller.tick(self._state, physics.data.time, residual_target)
        if tick.report is not None:
            self._report = worse(self._report, tick.report)
            if tick.report.failed:
                self._recorder.record.solver_failures += 1.0
        simulation.command(tick.command)
        self._outcome = simulation.run(self.config.physics_per_control, self._series)
        if self._outcome == "diverged":
            return
        self._look_for_overlap()
        following = self._controller.due(physics.data.time)
        if following is None or self._outcome != "running":
            self._sense()
        else:
            self._begin_jump(following)

    def _begin_jump(self, plan: JumpPlan) -> None:
        """A jump begins; the robot stands at rest in its crouch."""
        time, begun = self._simulation.physics.data.time, self._series.begun
        height, *more = self._heights[begun:]
        rest = REST if more else None
        truth = self._simulation.truth.read()
        foreseen_from = self.config.foreseen_from(plan.duration)
        self._series.begin(height, plan.duration, truth, time, rest, foreseen_from)
        self._estimator.reset()
        self._sense()
        self._start_com[:] = self._state.com
        following = self._planner.plan(more[0]) if more else None
        gravity = self._simulation.sensors.readings.gravity
        self._controller.start(plan, self._state, time, gravity, following)

    def _look_for_overlap(self) -> None:
        data = self._simulation.physics.data
        if data.time < self._next_look - 1e-9:
            return
        self._next_look = data.time + LOOK_PERIOD
        if self._self_collision.overlap(data.qpos) > TOLERANCE:
            self._recorder.record.self_collisions += 1.0

    def _sense(self) -> None:
        """From readings to the believed state, once per control tick."""
        self._state = self._estimator.estimate(self._simulation.sense())

    def _observe(self) -> None:
        readings, state = self._simulation.sensors.readings, self._state
        controller, episode_time = self._controller, self._simulation.physics.data.time
        plan, residual = controller.plan, controller.residual
        jump_time = controller.jump_time(episode_time)
        one_hot = np.zeros(len(Phase))
        one_hot[controller.phases.phase] = 1.0
        com_error = np.zeros(3)
        if controller.launching:
            controller.reference.update(jump_time)
            com_error = state.com - controller.reference.setpoint.com_position
        values: dict[str, NDArray[np.float64] | float] = {
            "phase": one_hot,
            "launch_progress": min(1.0, jump_time / plan.duration),
            "time": jump_time,
            "jump_height": self._series.height,
            "com_displacement": plan.displacement,
            "takeoff_time": plan.duration,
            "joint_position": readings.joint_position - self.robot.crouch,
            "joint_velocity": readings.joint_velocity,
            "gravity": readings.gravity,
            "gyro": readings.gyro,
            "com_offset": state.com - self._start_com,
            "com_velocity": state.com_velocity,
            "angular_momentum": state.angular_momentum,
            "com_error": com_error,
            "residual_offset": residual.offset[:3],
            "residual_velocity": residual.velocity[:3],
            "residual_momentum": residual.offset[3:],
            "residual_torque": residual.velocity[3:],
            "foot_force": readings.foot_force,
            "cop": readings.cop.ravel(),
            "contact": (readings.foot_force > LOADED).astype(float),
        }
        self._observation = self.layout.encode(values, self._memory)

    def _info(self) -> dict[str, Any]:
        series, jumps = self._series, self._series.jumps
        together = (
            {}
            if self.config.jumps == 1
            else {
                "jumps": tuple(jump.metrics.as_dict() for jump in jumps),
                "series": series.as_dict(self._simulation.truth.state),
            }
        )
        return together | {
            "jump": jumps[-1].metrics.as_dict(),
            "is_success": series.is_success,
            "outcome": self._outcome,
            "diverged": self._outcome == "diverged",
            "phase": self._controller.phases.phase.name.lower(),
            "time": float(self._simulation.physics.data.time),
            "jump_height": jumps[-1].height,
            **self._report.as_dict(),
        }
