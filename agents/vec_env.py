"""Environments side by side for training, each in a process of its own, that cannot hang."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import resource_tracker
from typing import Any

from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs

from agents.worker_process import Env, run_worker
from icub_jump_env.errors import InvalidValueError
from icub_jump_env.evaluation.episodes.parallel import WorkerError

_GRACE = 5.0
"""How long (s) workers may take to end by themselves."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Read by the linear algebra libraries when they are loaded."""


class JumpVecEnv(SubprocVecEnv):
    """Stable-Baselines3's ``SubprocVecEnv``, with errors where that one would wait for ever.

    A worker that dies, hangs or meets an error raises :class:`WorkerError` from whichever
    method waits for it. Nothing but :meth:`close` is of use after that. Workers answer what
    a training asks: steps, resets, ``get_attr`` and ``env_method``.

    Workers ignore Ctrl-C, which a terminal sends to them too: this process decides. They
    end when it dies, in whatever way, as then the connection to them closes. Processes are
    spawned: a spawned one holds only its own connection, so none keeps another's open, and
    takes its environment variables from here, which one of a fork server would not.
    """

    def __init__(self, env_fns: Sequence[Callable[[], Env]], patience: float = 60.0) -> None:
        """Start the workers and wait until they have built their environments.

        Args:
            env_fns: Builds an environment, one for each worker. Must be picklable.
            patience: How long (s) a worker may take to answer.

        Raises:
            WorkerError: If a worker dies, hangs or cannot build its environment.
        """
        self.waiting = False
        self.closed = False
        self.remotes: list[_Worker] = []
        try:
            with _inherited_by_workers():
                for index, make_env in enumerate(env_fns):
                    self.remotes.append(_Worker(index, make_env, patience))
            self.remotes[0].send(("get_spaces", None))
            observation_space, action_space = self.remotes[0].recv()
            VecEnv.__init__(self, len(env_fns), observation_space, action_space)
        except BaseException:
            self.close()
            raise

    def reset_all(self, seeds: Sequence[int]) -> VecEnvObs:
        """Reset each environment with its own seed.

        Args:
            seeds: One for each environment.

        Returns:
            The observations, stacked.

        Raises:
            InvalidValueError: If there are more or fewer.
            WorkerError: If a worker dies, hangs or meets an error.
        """
        if len(seeds) != self.num_envs:
            raise InvalidValueError("seeds", list(seeds), f"{self.num_envs}, one each")
        self._seeds = list(seeds)
        return self.reset()

    def close(self) -> None:
        """End the workers; those that do not end by themselves are killed."""
        if self.closed:
            return
        self.closed = True
        try:
            for worker in self.remotes:
                worker.disconnect()
            deadline = time.monotonic() + _GRACE
            for worker in self.remotes:
                worker.process.join(max(0.0, deadline - time.monotonic()))
        finally:  # also if an impatient Ctrl-C comes
            for worker in self.remotes:
                worker.process.kill()
            for worker in self.remotes:
                worker.process.join()


class _Worker:
    """A worker process, in the role of the connection to it."""

    def __init__(self, index: int, make_env: Callable[[], Env], patience: float) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._name = f"worker {index}"
        self._patience = patience
        self.process = context.Process(
            target=run_worker, args=(theirs, make_env), name=self._name, daemon=True
        )
        with theirs:
            self.process.start()

    def send(self, request: tuple[str, Any]) -> None:
        """Hand over a request.

        Raises:
            WorkerError: If the worker is dead, with its last words, if any.
        """
        try:
            self._connection.send(request)
        except OSError as error:
            self.recv()
            raise self._death() from error

    def recv(self) -> Any:
        """Wait for the answer.

        Raises:
            WorkerError: If the worker dies, hangs or meets an error.
        """
        try:
            if not self._connection.poll(self._patience):
                raise WorkerError(f"{self._name} has not answered for {self._patience:g} s")
            failure, result = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._death() from error
        if failure is not None:
            raise WorkerError(f"{self._name} failed: {failure}")
        return result

    def disconnect(self) -> None:
        """Close the connection, upon which the worker ends."""
        self._connection.close()

    def _death(self) -> WorkerError:
        self.process.join(_GRACE)
        return WorkerError(f"{self._name} died (exit code {self.process.exitcode})")


@contextlib.contextmanager
def _inherited_by_workers() -> Iterator[None]:
    """For processes started meanwhile: no Ctrl-C, and one thread unless the user said else.

    Ctrl-C is held back here, not lost.
    """
    resource_tracker.ensure_running()  # it would let Ctrl-C through when it starts
    added = [name for name in _THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
        signal.pthread_sigmask(signal.SIG_SETMASK, before)  # here a held one comes
