"""Many episodes, one after the other or side by side: in worker processes, or on a cluster."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.episodes.cluster import Cluster, Jobs, Slot, check_plans
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode
from icub_jump_env.evaluation.report.output import progress_display
from icub_jump_env.policy import BASELINE, Policy
from icub_jump_env.workers import (
    WorkerError,
    end_workers,
    start_workers,
    wait_for_any,
)


class Job(NamedTuple):
    """An episode to be run."""

    config: JumpConfig
    seed: int
    policy: Policy = BASELINE


Results = Generator[tuple[int, Episode], None, None]


def run_jobs(work: Sequence[Job], jobs: Jobs) -> Results:
    """Run episodes, several at a time; their results do not depend on ``jobs``.

    Closing the generator, or an error, ends the workers.

    Args:
        work: The episodes. Equal configurations in a row share an environment.
        jobs: Number of worker processes; 1 runs one episode after the other right here. Or
            the cluster that runs them.

    Yields:
        Index into ``work`` and the episode, as they finish.

    Raises:
        WorkerError: If a worker dies or meets an error; it names the seed. On a cluster a dead
            one is first replaced, some times.
        ClusterError: If the cluster cannot be joined, or a node has other code.
        MissingDependencyError: If there is no Ray for it.
        ConfigError: If an episode follows plans that the cluster need not have.
    """
    if isinstance(jobs, Cluster):
        for job in work:
            check_plans(job.config)
        with jobs.slots(_Runner, len(work)) as slots:
            yield from _deal_out(work, slots, Slot.wait_for_any)
        return
    jobs = min(jobs, len(work))
    if jobs > 1:
        workers = start_workers([_Runner] * jobs)
        try:
            yield from _deal_out(work, workers, wait_for_any)
        finally:
            end_workers(workers)
        return
    with contextlib.closing(_Runner()) as run:
        for index, job in enumerate(work):
            yield index, run(job)


def run_all(work: Sequence[Job], jobs: Jobs, console: Console) -> list[Episode]:
    """Run episodes as :func:`run_jobs` does, with a progress display on ``console``.

    Returns:
        The episodes, in the order of ``work``.
    """
    episodes = {}
    with progress_display(console) as display, contextlib.closing(run_jobs(work, jobs)) as results:
        task = display.add_task("jumping", total=len(work))
        for index, episode in results:
            episodes[index] = episode
            display.advance(task)
    return [episodes[index] for index in range(len(work))]


class _Runner:
    """Runs episodes; equal configurations in a row share an environment."""

    def __init__(self) -> None:
        self._config: JumpConfig | None = None
        self._env: ICubJumpEnv | None = None

    def __call__(self, job: Job) -> Episode:
        if self._env is None or job.config != self._config:
            self.close()
            self._env, self._config = make_env(job.config), job.config
        return run_episode(self._env, job.seed, job.policy)

    def close(self) -> None:
        if self._env is not None:
            self._env.close()


class _Worker(Protocol):
    """What takes one job at a time."""

    def send(self, job: Job, /) -> None: ...

    def recv(self) -> Any: ...


_W = TypeVar("_W", bound=_Worker)


def _deal_out(
    work: Sequence[Job], workers: Sequence[_W], wait_for_any: Callable[[Iterable[_W]], list[_W]]
) -> Results:
    queue = iter(enumerate(work))
    running: dict[_W, int] = {}

    def hand_out(worker: _W) -> None:
        for index, job in itertools.islice(queue, 1):
            running[worker] = index
            with _named(job.seed):
                worker.send(job)

    for worker in workers:
        hand_out(worker)
    while running:
        for worker in wait_for_any(running):
            index = running.pop(worker)
            with _named(work[index].seed):
                episode: Episode = worker.recv()
            hand_out(worker)
            yield index, episode


@contextlib.contextmanager
def _named(seed: int) -> Generator[None, None, None]:
    try:
        yield
    except WorkerError as error:
        raise WorkerError(f"seed {seed}: {error}") from error
