"""The environment as a training sees it: the launch alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode
from icub_jump_env.observation import OBSERVATION_LIMIT
from icub_jump_env.planning.residual import RESIDUAL_TIME
from icub_jump_env.policy import Policy
from icub_jump_env.robot.kinematics import FeetFixedKinematics

Array = NDArray[np.float32]
Env = gymnasium.Env[Any, Any]


def acting_steps(config: JumpConfig) -> int:
    """Steps of the longest launch that a configuration commands.

    And of flight and landing, if the residual acts there.
    """
    # The lowest jump launches longest, or the highest: that depends on the scaling.
    planner = config.make_planner(FeetFixedKinematics(config.robot_value))
    longest = max(planner.plan(height).duration for height in config.jump_heights)
    if config.residual.phases == "all":
        longest += RESIDUAL_TIME
    return math.ceil(longest * config.agent_frequency)


WORLD = {
    "payload_mass": 1.0, "payload_offset": 0.02, "friction": 0.5, "delay": 2.0, "slope": 0.05,
    "lateral_slope": 0.05, "push": 5.0, "push_time": 1.0, "push_direction": 3.0,
    "takeoff_spin": 0.5, "flight_push": 5.0, "flight_push_direction": 3.0, "floor_tilt": 0.05,
    "floor_tilt_lateral": 0.05, "step": 0.02, "edge": 0.02, "landing_push": 5.0,
    "landing_push_direction": 3.0, "flight_push_time": 0.2, "landing_push_time": 1.0,
    "encoder_bias": 0.05,
}  # fmt: skip
"""What a critic sees of the world, and by what it is divided; not what varies from link to link or
joint to joint, but for the encoders."""

STATE = {
    "com": 0.1, "com_velocity": 1.0, "angular_momentum": 1.0, "base_pitch": 0.2,
    "ground_force": 300.0,
}  # fmt: skip
"""The same of the true state; of the CoM's position what changed since the reset."""


class LaunchEnv(gymnasium.Env[Array, Array]):
    """The steps in which actions matter, and the sum of all rewards.

    Every episode has as many steps as the longest launch, so that environments side by
    side end theirs together; the step that ends it brings the rewards of flight and
    landing, too. If the jump is over before, the remaining steps do and cost nothing.
    Agents see some entries of the observation and use some axes of the action; the others
    are zero. Episodes end early (:mod:`icub_jump_env.metrics.foresight`). Behind what an agent
    sees may stand what only its critic sees, the world and the true state.
    """

    def __init__(
        self,
        config: JumpConfig,
        inputs: Sequence[str],
        axes: Sequence[str],
        privileged: bool = False,
    ) -> None:
        """Build the environment.

        Args:
            config: The jump.
            inputs: Names of the entries of the observation that the agent sees.
            axes: Axes of the action that it uses.
            privileged: Whether to add what only a critic sees.
        """
        self.env: ICubJumpEnv = make_env(config.replace(early_end=True))
        entries, action_axes = list(self.env.layout.scales), config.residual.axes
        self._columns = [entries.index(name) for name in inputs]
        self._axes = [action_axes.index(axis) for axis in axes]
        self._n_steps = acting_steps(config)
        self._scale = 1.0
        self._step = 0
        self._over, self._privileged = False, privileged
        self._world = self._hidden = np.zeros(0, np.float32)
        self._start = np.zeros(3)
        size = len(inputs)
        if privileged:
            observation, _ = self.reset(seed=0)
            size = len(observation)
        self.observation_space = spaces.Box(
            -OBSERVATION_LIMIT, OBSERVATION_LIMIT, (size,), np.float32
        )
        self.action_space = spaces.Box(-1.0, 1.0, (len(axes),), np.float32)

    def scale_actions(self, scale: float) -> None:
        """Multiply actions by ``scale`` from now on."""
        self._scale = scale

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """As :meth:`ICubJumpEnv.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._step, self._over = 0, False
        if self._privileged:
            world = info["world"]
            values = [np.ravel(world[name]) / scale for name, scale in WORLD.items()]
            self._world = np.concatenate(values).astype(np.float32)
            self._start = self.env.snapshot().com
        return self._seen(observation), info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """As :meth:`ICubJumpEnv.step`; the last one goes on to the end of the episode."""
        residual = np.zeros(self.env.action_space.shape or (), np.float32)
        if not self._over:
            residual[self._axes] = self._scale * np.clip(action, -1.0, 1.0)
        self._step += 1
        ends = self._step >= self._n_steps
        observation, reward, self._over, _, info = self.env.step(residual)
        while ends and not self._over:
            observation, more, self._over, _, info = self.env.step(np.zeros_like(residual))
            reward += more
        return self._seen(observation, info["diverged"]), reward, ends, False, info

    def _seen(self, observation: Array, diverged: bool = False) -> Array:
        """What the agent sees and, behind it, what its critic does."""
        chosen = observation[self._columns]
        if not self._privileged:
            return chosen
        if not diverged:
            truth, start = self.env.snapshot(), {"com": self._start}
            state = [
                np.ravel((getattr(truth, name) - start.get(name, 0.0)) / scale)
                for name, scale in STATE.items()
            ]
            self._hidden = np.concatenate((self._world, *state)).astype(np.float32)
        both = np.concatenate((chosen, self._hidden))
        seen: Array = np.clip(both, -OBSERVATION_LIMIT, OBSERVATION_LIMIT)
        return seen

    def evaluate(self, policy: Policy, seeds: Sequence[int]) -> list[Episode]:
        """Episodes of a policy that sees the whole observation, without exploration."""
        return [run_episode(self.env, seed, policy) for seed in seeds]

    def close(self) -> None:
        """As :meth:`ICubJumpEnv.close`."""
        self.env.close()


class EnvServer:
    """Answers what Stable-Baselines3's ``SubprocVecEnv`` asks in a training, in a worker.

    It stands here, and not beside :class:`agents.vec_env.JumpVecEnv`, so that a worker imports
    what its environment needs, and not torch.
    """

    def __init__(self, make_env: Callable[[], Env]) -> None:
        self._env = make_env()

    def __call__(self, request: tuple[str, Any]) -> Any:
        """Answer a request: a command and its arguments."""
        command, data = request
        match command:
            case "step":
                return self._step(data)
            case "reset":
                seed, options = data
                return self._env.reset(seed=seed, options=options or None)
            case "get_spaces":
                return self._env.observation_space, self._env.action_space
            case "get_attr":
                return self._env.get_wrapper_attr(data)
            case "env_method":
                name, args, kwargs = data
                return self._env.get_wrapper_attr(name)(*args, **kwargs)
        raise NotImplementedError(f"a worker does not know {command!r}")

    def close(self) -> None:
        """Free the environment."""
        self._env.close()

    def _step(self, action: Array) -> tuple[Any, ...]:
        """One step, and the next reset if it ends the episode, as Stable-Baselines3 wants them."""
        observation, reward, terminated, truncated, info = self._env.step(action)
        done = terminated or truncated
        info["TimeLimit.truncated"] = truncated and not terminated
        reset_info: dict[str, Any] = {}
        if done:
            info["terminal_observation"] = observation
            observation, reset_info = self._env.reset()
        return observation, reward, done, info, reset_info
