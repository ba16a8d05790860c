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
from icub_jump_env.observation import OBSERVATION_LIMIT, entry_scales
from icub_jump_env.planning.residual import RESIDUAL_TIME
from icub_jump_env.policy import Policy
from icub_jump_env.policy.fields import AXES
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


class LaunchEnv(gymnasium.Env[Array, Array]):
    """The steps in which actions matter, and the sum of all rewards.

    Every episode has as many steps as the longest launch, so that environments side by
    side end theirs together; the step that ends it brings the rewards of flight and
    landing, too. If the jump is over before, the remaining steps do and cost nothing.
    Agents see some entries of the observation and use some axes of the action; the others
    are zero. Episodes end early (:mod:`icub_jump_env.metrics.foresight`).
    """

    def __init__(self, config: JumpConfig, inputs: Sequence[str], axes: Sequence[str]) -> None:
        """Build the environment.

        Args:
            config: The jump.
            inputs: Names of the entries of the observation that the agent sees.
            axes: Axes of the action that it uses.
        """
        self.env: ICubJumpEnv = make_env(config.replace(early_end=True))
        entries = list(entry_scales())
        self._columns = [entries.index(name) for name in inputs]
        self._axes = [AXES.index(axis) for axis in axes]
        self._n_steps = acting_steps(config)
        self._scale = 1.0
        self._step = 0
        self._over = False
        self.observation_space = spaces.Box(
            -OBSERVATION_LIMIT, OBSERVATION_LIMIT, (len(inputs),), np.float32
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
        return observation[self._columns], info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """As :meth:`ICubJumpEnv.step`; the last one goes on to the end of the episode."""
        residual = np.zeros(len(AXES), np.float32)
        if not self._over:
            residual[self._axes] = self._scale * np.clip(action, -1.0, 1.0)
        self._step += 1
        ends = self._step >= self._n_steps
        observation, reward, self._over, _, info = self.env.step(residual)
        while ends and not self._over:
            observation, more, self._over, _, info = self.env.step(np.zeros_like(residual))
            reward += more
        return observation[self._columns], reward, ends, False, info

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
