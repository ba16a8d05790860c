"""Many episodes, one after the other or side by side in worker processes."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Generator, Sequence
from typing import NamedTuple

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode
from icub_jump_env.evaluation.episodes.workers import (
    Worker,
    WorkerError,
    end_workers,
    start_workers,
    wait_for_any,
)
from icub_jump_env.evaluation.report.output import progress_display
from icub_jump_env.policy import BASELINE, Policy


class Job(NamedTuple):
    """An episode to be run."""

    config: JumpConfig
    seed: int
    policy: Policy = BASELINE


Results = Generator[tuple[int, Episode], None, None]


def run_jobs(work: Sequence[Job], jobs: int) -> Results:
    """Run episodes, ``jobs`` at a time; their results do not depend on ``jobs``.

    Closing the generator, or an error, ends the workers.

    Args:
        work: The episodes. Equal configurations in a row share an environment.
        jobs: Number of worker processes; 1 runs one episode after the other right here.

    Yields:
        Index into ``work`` and the episode, as they finish.

    Raises:
        WorkerError: If a worker dies or meets an error; it names the seed.
    """
    jobs = min(jobs, len(work))
    if jobs > 1:
        yield from _run_in_workers(work, jobs)
        return
    with contextlib.closing(_Runner()) as run:
        for index, job in enumerate(work):
            yield index, run(job)


def run_all(work: Sequence[Job], jobs: int, console: Console) -> list[Episode]:
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


def _run_in_workers(work: Sequence[Job], jobs: int) -> Results:
    queue = iter(enumerate(work))
    running: dict[Worker, int] = {}

    def hand_out(worker: Worker) -> None:
        for index, job in itertools.islice(queue, 1):
            running[worker] = index
            with _named(job.seed):
                worker.send(job)

    workers = start_workers([_Runner] * jobs)
    try:
        for worker in workers:
            hand_out(worker)
        while running:
            for worker in wait_for_any(running):
                index = running.pop(worker)
                with _named(work[index].seed):
                    episode: Episode = worker.recv()
                hand_out(worker)
                yield index, episode
    finally:
        end_workers(workers)


@contextlib.contextmanager
def _named(seed: int) -> Generator[None, None, None]:
    try:
        yield
    except WorkerError as error:
        raise WorkerError(f"seed {seed}: {error}") from error
