"""The environment as a training sees it: the launch alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.jump import RESIDUAL_TIME
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.rollout import Episode, make_env, run_episode
from icub_jump_env.observation import OBSERVATION_LIMIT, entry_scales
from icub_jump_env.policy import Policy
from icub_jump_env.policy.fields import AXES
from icub_jump_env.reference.com_trajectory import plan_com_trajectory

Array = NDArray[np.float32]


def acting_steps(config: JumpConfig) -> int:
    """Steps of the longest launch that a configuration commands.

    And of flight and landing, if the residual acts there.
    """
    # The lowest jump launches longest, or the highest: that depends on the scaling.
    longest = max(
        plan_com_trajectory(height, config.com_displacement, config.com_scaling).duration
        for height in config.jump_heights
    )
    if config.residual_phases == "all":
        longest += RESIDUAL_TIME
    return math.ceil(longest * config.agent_frequency)


class LaunchEnv(gymnasium.Env[Array, Array]):
    """The steps in which actions matter, and the sum of all rewards.

    Every episode has as many steps as the longest launch, so that environments side by
    side end theirs together; the step that ends it brings the rewards of flight and
    landing, too. If the jump is over before, the remaining steps do and cost nothing.
    Agents see some entries of the observation and use some axes of the action; the others
    are zero.
    """

    def __init__(
        self, config: JumpConfig, inputs: Sequence[str], axes: Sequence[str], number: int = 0
    ) -> None:
        """Build the environment.

        Args:
            config: The jump.
            inputs: Names of the entries of the observation that the agent sees.
            axes: Axes of the action that it uses.
            number: Which of several environments side by side it is.
        """
        self.env: ICubJumpEnv = make_env(config)
        entries = list(entry_scales())
        self._columns = [entries.index(name) for name in inputs]
        self._axes = [AXES.index(axis) for axis in axes]
        self._n_steps = acting_steps(config)
        self._number = number
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
        """An episode of a policy, without exploration.

        Args:
            policy: What acts, on the whole observation.
            seeds: One for each of the environments side by side; the last may get none.

        Returns:
            The episode of this environment, if any.
        """
        mine = seeds[self._number : self._number + 1]
        return [run_episode(self.env, seed, policy) for seed in mine]

    def close(self) -> None:
        """As :meth:`ICubJumpEnv.close`."""
        self.env.close()
