"""Environments side by side for Stable-Baselines3: each in a worker of its own, or in threads."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs

from icub_jump_env.errors import ConfigError, InvalidValueError
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.policy import Policy
from icub_jump_env.vector import ICubJumpVectorEnv
from icub_jump_env.workers import end_workers, start_workers

from .environment import Env, EnvServer


class JumpVecEnv(SubprocVecEnv):
    """Stable-Baselines3's ``SubprocVecEnv`` on our workers: errors where it would wait for ever.

    A worker that dies or meets an error raises :class:`WorkerError` from whichever method
    waits for it. Nothing but :meth:`close` is of use after that.
    """

    def __init__(self, env_fns: Sequence[Callable[[], Env]]) -> None:
        """Start the workers and wait until they have built their environments.

        Args:
            env_fns: Builds an environment, one for each worker. Must be picklable.

        Raises:
            WorkerError: If a worker dies or cannot build its environment.
        """
        self.waiting = False
        self.closed = False
        self.remotes = start_workers(partial(EnvServer, make) for make in env_fns)
        try:
            self.remotes[0].send(("get_spaces", None))
            observation_space, action_space = self.remotes[0].recv()
            VecEnv.__init__(self, len(env_fns), observation_space, action_space)
        except BaseException:
            self.close()
            raise

    def reset_all(self, seeds: Sequence[int]) -> NDArray[Any]:
        """Reset each environment with its own seed.

        Args:
            seeds: One for each environment.

        Returns:
            The observations, stacked.

        Raises:
            InvalidValueError: If there are more or fewer.
            WorkerError: If a worker dies or meets an error.
        """
        if len(seeds) != self.num_envs:
            raise InvalidValueError("seeds", list(seeds), f"{self.num_envs}, one each")
        for worker, seed in zip(self.remotes, seeds, strict=True):
            worker.send(("reset", (seed, {})))
        answers = [worker.recv() for worker in self.remotes]
        observations, infos = zip(*answers, strict=True)
        self.reset_infos = list(infos)
        return np.stack(observations)

    def evaluate(self, policy: Policy, seeds: Sequence[int]) -> list[Episode]:
        """Episodes of a policy without exploration, dealt out to the environments.

        Returns:
            The episodes in ascending order of their seeds.

        Raises:
            WorkerError: If a worker dies or meets an error.
        """
        for number, worker in enumerate(self.remotes):
            mine = seeds[number :: self.num_envs]
            worker.send(("env_method", ("evaluate", (policy, mine), {})))
        episodes = itertools.chain(*(worker.recv() for worker in self.remotes))
        return sorted(episodes, key=lambda episode: episode.seed)

    def close(self) -> None:
        """End the workers."""
        end_workers(self.remotes)
        self.closed = True


class ThreadVecEnv(DummyVecEnv):
    """Stable-Baselines3's ``DummyVecEnv`` on the threads of a vector environment."""

    def __init__(self, envs: ICubJumpVectorEnv) -> None:
        """Use a vector environment.

        Args:
            envs: Made with ``autoreset_mode="SameStep"``, as Stable-Baselines3 resets. It is
                closed with this one.

        Raises:
            ConfigError: If it was not.
        """
        if envs.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ConfigError("autoreset_mode", envs.autoreset_mode.value, "'SameStep'")
        self._threads = envs
        super().__init__([partial(_same, env) for env in envs.envs])

    def reset(self) -> VecEnvObs:
        """Start episodes."""
        self._threads.forget()
        return super().reset()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the steps, (num_envs, n) actions; ``step_wait`` returns the results."""
        super().step_async(actions)
        self._threads.go_ahead(actions)

    def close(self) -> None:
        """Close the vector environment."""
        self._threads.close()


def _same(env: Env) -> Env:
    return env
