"""Environments side by side in one process, stepped by threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from icub_jump_env.checks import check_action, check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ActionError, ConfigError

Array = NDArray[np.float32]
Env = gymnasium.Env[Array, Array]

MOST_THREADS = 4
"""More would wait for Python's global lock, which half of a step and more holds."""

_MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)


class AheadEnv(gymnasium.Wrapper[Array, Array, Array, Array]):
    """An environment that can take its next step before it is asked for the result.

    Threads let the environments go ahead; who asks them one after the other then need not wait.
    """

    def __init__(self, env: Env, autoreset_mode: AutoresetMode) -> None:
        """Wrap an environment.

        Args:
            env: The environment.
            autoreset_mode: When it will be reset after an episode.
        """
        super().__init__(env)
        self._same_step = autoreset_mode is AutoresetMode.SAME_STEP
        self._over = False
        self._results: deque[Any] = deque()

    def go_ahead(self, action: NDArray[np.floating]) -> None:
        """Take the next step, or the reset that comes with it or in its place."""
        self.forget()
        if not self._over:
            result = self.env.step(action)
            self._over = result[2] or result[3]
            self._results.append(result)
            if not (self._over and self._same_step):
                return
        self._results.append(self.env.reset())
        self._over = False

    def forget(self) -> None:
        """Drop the results of steps that nobody asked for."""
        self._results.clear()

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """The step taken ahead, else a step."""
        return self._results.popleft() if self._results else self.env.step(action)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """The reset taken ahead, else a reset."""
        if not self._results:
            self._over = False
            self._results.append(self.env.reset(seed=seed, options=options))
        result: tuple[Array, dict[str, Any]] = self._results.popleft()
        return result


class ICubJumpVectorEnv(SyncVectorEnv):
    """:class:`icub_jump_env.env.ICubJumpEnv` several times, as in Gymnasium's ``SyncVectorEnv``.

    ``gymnasium.make_vec("ICubJump-v1", num_envs=8)`` makes one. The physics and compiled functions
    run without Python's global lock, so threads take the steps of several environments at a time.
    Results are those of single environments bit for bit, whatever thread takes which.
    """

    envs: list[AheadEnv]  # type: ignore[assignment]  # a list of some kind of environments

    def __init__(
        self,
        num_envs: int,
        max_episode_steps: int,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **config: Any,
    ) -> None:
        """Build the environments.

        Args:
            num_envs: How many.
            max_episode_steps: Steps after which an episode is truncated.
            autoreset_mode: Whether an environment is reset in the step after its episode,
                ``"NextStep"``, or in the last one, ``"SameStep"``.
            config: As of :class:`icub_jump_env.env.ICubJumpEnv`.

        Raises:
            UnknownFieldError: If there is no such field; a ``TypeError``.
            ConfigError: If a field is out of range.
        """
        check_count("num_envs", num_envs, 1)
        check_count("max_episode_steps", max_episode_steps, 1)
        names = [mode.value for mode in _MODES]
        if autoreset_mode not in (*_MODES, *names):
            raise ConfigError("autoreset_mode", autoreset_mode, f"one of {names}")
        mode = AutoresetMode(autoreset_mode)
        if JumpConfig.of(**config).rendering.mode == "human":
            raise ConfigError(
                "render_mode", "human", "None or 'rgb_array' of several environments"
            )

        def make() -> AheadEnv:
            return AheadEnv(TimeLimit(ICubJumpEnv(**config), max_episode_steps), mode)

        super().__init__([make] * num_envs, autoreset_mode=mode)
        self._helpers = min(num_envs, os.cpu_count() or 1, MOST_THREADS) - 1
        self._threads = ThreadPoolExecutor(max(1, self._helpers))

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start episodes.

        Args:
            seed: That of the first environment, the others take the next ones; or one each.
            options: As of :meth:`icub_jump_env.env.ICubJumpEnv.reset`, for each environment;
                ``reset_mask``, (num_envs,) bool, says which are reset.

        Returns:
            Observations, (num_envs, size), and info.

        Raises:
            ConfigError: If a seed or an option is unknown or out of range.
            ValueError: If there are more or fewer seeds than environments.
        """
        self.forget()
        return super().reset(seed=seed, options=options)

    def step(self, actions: Array) -> tuple[Array, Any, Any, Any, dict[str, Any]]:
        """Advance each environment by ``dt``, or reset it if its episode was over.

        Args:
            actions: (num_envs, n), those of each, in [-1, 1]; what lies beyond is clipped.

        Returns:
            Observations, (num_envs, size); rewards, terminated and truncated, (num_envs,); info.

        Raises:
            ActionError: If an action is misshapen or not finite; no environment has moved.
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        self.go_ahead(actions)
        return super().step(actions)

    def go_ahead(self, actions: Iterable[Any]) -> None:
        """Let the environments take their next steps, each in the next free thread.

        Args:
            actions: As of :meth:`step`.

        Raises:
            ActionError, gymnasium.error.ResetNeeded: As :meth:`step`.
        """
        size = gymnasium.spaces.flatdim(self.single_action_space)
        checked = [check_action(action, size) for action in actions]
        if len(checked) != self.num_envs:
            raise ActionError("actions", actions, f"{self.num_envs}, one for each environment")
        pending = deque(zip(self.envs, checked, strict=True))
        helpers = [self._threads.submit(_work, pending) for _ in range(self._helpers)]
        try:
            _work(pending)
        finally:
            wait(helpers)  # after an error no environment moves on
        for helper in helpers:
            helper.result()

    def forget(self) -> None:
        """Drop the results of steps that nobody asked for, because of an error or an interrupt."""
        for env in self.envs:
            env.forget()

    def close_extras(self, **kwargs: Any) -> None:
        """Free renderers and threads."""
        super().close_extras(**kwargs)
        self._threads.shutdown()


def _work(pending: deque[tuple[AheadEnv, NDArray[np.float64]]]) -> None:
    while True:
        try:
            env, action = pending.popleft()
        except IndexError:  # all are taken
            return
        env.go_ahead(action)
