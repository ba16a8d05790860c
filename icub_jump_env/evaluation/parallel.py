"""Episodes side by side, in worker processes of Ray."""

from __future__ import annotations

import contextlib
import functools
import itertools
import logging
import os
import secrets
import signal
import sys
import tempfile
import threading
from collections.abc import Generator, Iterator, Sequence
from typing import Any, NamedTuple, Self

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ICubJumpError, MissingDependencyError
from icub_jump_env.evaluation.output import progress_display
from icub_jump_env.evaluation.rollout import Episode, make_env, run_episode
from icub_jump_env.policy import BASELINE, Policy


class Job(NamedTuple):
    """An episode to be run."""

    config: JumpConfig
    seed: int
    policy: Policy = BASELINE


Work = Sequence[Job]
Results = Generator[tuple[int, Episode], None, None]

_REMEDY = (
    "several jobs need the extra 'parallel', in the repository's folder: "
    'pip install -c constraints.txt -e ".[parallel]"'
)

_RAY_SETTINGS = {
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # on any system: listen on loopback alone
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_DISABLE_FAILURE_SIGNAL_HANDLER": "1",  # which prints a stack trace on SIGTERM
    "RAY_AUTH_TOKEN": secrets.token_hex(32),  # else Ray leaves one in ~/.ray
}
"""Read when Ray is imported; those that the user has set remain."""


_PATIENCE = 0.2
"""How long (s) to wait for a result before looking for an interrupt."""


class WorkerError(ICubJumpError, RuntimeError):
    """A worker process failed or died, or Ray did not start."""


def run_jobs(work: Work, jobs: int) -> Results:
    """Run episodes, ``jobs`` at a time; their results do not depend on ``jobs``.

    A Ray cluster that this process is connected to is used, and left running; otherwise
    one of local processes lives as long as the generator. Closing the generator, or an
    error, ends it.

    Args:
        work: The episodes. Equal configurations in a row share
            an environment.
        jobs: Number of worker processes; 1 runs one episode after the other right here.

    Returns:
        Index into ``work`` and the episode, as they finish.

    Raises:
        MissingDependencyError: If Ray is needed and not installed.
        WorkerError: From the generator, if Ray does not start, an episode raises an error
            in its worker, or the worker dies.
    """
    jobs = min(jobs, len(work))
    return _run_here(work) if jobs <= 1 else _run_in_workers(_import_ray(), work, jobs)


def run_all(work: Work, jobs: int, console: Console) -> list[Episode]:
    """Run episodes as :func:`run_jobs` does, with a progress display on ``console``.

    Returns:
        The episodes, in the order of ``work``.
    """
    with progress_display(console) as display:
        task = display.add_task("jumping", total=len(work))
        episodes = {}
        for index, episode in run_jobs(work, jobs):
            episodes[index] = episode
            display.advance(task)
    return [episodes[index] for index in range(len(work))]


def check_jobs(jobs: int) -> None:
    """Refuse early if so many jobs cannot run here.

    Raises:
        MissingDependencyError: If Ray is needed and not installed.
    """
    if jobs > 1:
        _import_ray()


def _run_here(work: Work) -> Results:
    for config, jobs in itertools.groupby(enumerate(work), key=lambda item: item[1].config):
        with contextlib.closing(make_env(config)) as env:
            for index, job in jobs:
                yield index, run_episode(env, job.seed, job.policy)


def _run_in_workers(ray: Any, work: Work, jobs: int) -> Results:
    queue = iter(enumerate(work))
    running: dict[Any, int] = {}

    def submit(count: int) -> None:
        for index, job in itertools.islice(queue, count):
            running[task.remote(job)] = index

    with _cluster(ray, jobs), _Interrupts() as interrupts:
        # A dead worker is a failure to report, not to retry.
        task = ray.remote(num_cpus=1, max_retries=0)(_run_in_worker)
        try:
            submit(jobs)
            while running:
                interrupts.check()
                finished, _ = ray.wait(list(running), num_returns=1, timeout=_PATIENCE)
                for done in finished:
                    index = running.pop(done)
                    submit(1)
                    yield index, _result(ray, done, seed=work[index].seed)
        finally:
            for unfinished in running:
                ray.cancel(unfinished, force=True)


class _Interrupts:
    """Notes Ctrl-C and SIGTERM instead of obeying at once, which crashes Ray if it is busy."""

    def __init__(self) -> None:
        self._seen = False
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._previous[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _note(self, *_: object) -> None:
        self._seen = True

    def check(self) -> None:
        """Obey now.

        Raises:
            KeyboardInterrupt: If one was noted.
        """
        if self._seen:
            raise KeyboardInterrupt


def _result(ray: Any, done: Any, seed: int) -> Episode:
    try:
        episode: Episode = ray.get(done)
    except ray.exceptions.RayError as error:
        cause = getattr(error, "cause", None) or error
        reason = " ".join(f"{type(cause).__name__}: {cause}".split())
        raise WorkerError(f"seed {seed} failed in its worker: {reason}") from error
    return episode


def _run_in_worker(job: Job) -> Episode:
    return run_episode(_worker_env(job.config), job.seed, job.policy)


@functools.lru_cache(maxsize=1)
def _worker_env(config: JumpConfig) -> ICubJumpEnv:
    return make_env(config)


def _import_ray() -> Any:
    if "ray" not in sys.modules:
        for name, value in _RAY_SETTINGS.items():
            os.environ.setdefault(name, value)
    try:
        import ray
    except ImportError as error:
        raise MissingDependencyError(_REMEDY) from error
    return ray


@contextlib.contextmanager
def _cluster(ray: Any, jobs: int) -> Iterator[None]:
    """The cluster in use, or a local one for the time being."""
    if ray.is_initialized():
        yield
        return
    # In /tmp, as Ray itself: the names of its sockets must stay short.
    with tempfile.TemporaryDirectory(dir="/tmp", ignore_cleanup_errors=True) as folder:
        # What Ray's daemon says of a dead worker goes to stdout, and no option prevents it.
        ray._private.worker._worker_logs_enabled = False
        try:
            _start(ray, jobs, folder)
            yield
        finally:
            # An impatient second Ctrl-C would leave processes behind.
            with _uninterrupted():
                ray.shutdown(wait_for_processes=True)
            ray._private.worker._worker_logs_enabled = True


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ignore Ctrl-C for the time being, where signals can be handled."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _start(ray: Any, jobs: int, folder: str) -> None:
    variables = {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        # Workers shall import what this process imports, however it was started.
        "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path)),
    }
    try:
        # Ctrl-C halfway would leave processes behind, so it waits. And Ray makes the current
        # folder the first that workers import from.
        with ray._private.utils.DeferSigint.create_if_main_thread(), contextlib.chdir(folder):
            ray.init(
                "local",
                num_cpus=jobs,
                include_dashboard=False,
                log_to_driver=False,
                logging_level=logging.CRITICAL,
                runtime_env={"env_vars": variables},
                _temp_dir=folder,
            )
    except Exception as error:
        raise WorkerError(f"Ray did not start: {' '.join(str(error).split())}") from error
