"""Worker processes: each answers requests, one after the other, over a connection of its own.

All local parallel work goes through here: episodes side by side in an evaluation
(:mod:`~icub_jump_env.evaluation.episodes.parallel`), environments side by side in a training, and
what may crash without us (:mod:`~icub_jump_env.simulation.viewers.browser`).
A connection of its own tells which worker died. ``concurrent.futures`` does not tell, and its
processes outlive a killed parent.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol

from icub_jump_env.errors import ICubJumpError

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Read by the linear algebra libraries when they are loaded."""

_LAST_BREATH = 5.0
"""How long (s) a process may take to end once its connection is closed."""


class WorkerError(ICubJumpError, RuntimeError):
    """A worker process failed or died."""


class Server(Protocol):
    """What answers the requests in a worker."""

    def __call__(self, request: Any, /) -> Any:
        """Answer a request."""
        ...

    def close(self) -> None:
        """Free what it holds."""
        ...


class Worker:
    """A process that answers requests.

    It ignores Ctrl-C, which a terminal sends to it too: this process decides. It ends when
    this process dies, in whatever way, as then the connection to it closes. Processes are
    spawned: a spawned one holds no connection but its own, so none keeps another's open. A
    program of one's own that starts workers needs ``if __name__ == "__main__":``.

    Attributes:
        name: What errors call it.
        process: The process.
    """

    def __init__(self, name: str, make_server: Callable[[], Server]) -> None:
        """Start the process, with one thread unless the user said else.

        Args:
            name: What errors call it.
            make_server: Builds what answers, in the process. Must be picklable.
        """
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self.name = name
        self.process = context.Process(
            target=_serve, args=(theirs, make_server), name=name, daemon=True
        )
        try:
            with theirs, _inherited():
                self.process.start()
        except BaseException:  # a Ctrl-C that was held back
            self.end()
            raise

    def send(self, request: Any) -> None:
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
            WorkerError: If the worker dies or meets an error.
        """
        try:
            failure, answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._death() from error
        if failure is not None:
            raise WorkerError(f"{self.name} failed: {failure}")
        return answer

    def end(self) -> None:
        """End the process, whatever it does."""
        if self.process.pid is not None:
            self.process.kill()
            self.process.join()
        self._connection.close()

    def _death(self) -> WorkerError:
        self.process.join(_LAST_BREATH)
        return WorkerError(f"{self.name} died (exit code {self.process.exitcode})")


def start_workers(make_servers: Iterable[Callable[[], Server]]) -> list[Worker]:
    """Start a worker for each of the servers."""
    workers: list[Worker] = []
    try:
        for index, make_server in enumerate(make_servers):
            workers.append(Worker(f"worker {index}", make_server))
    except BaseException:
        end_workers(workers)
        raise
    return workers


def wait_for_any(workers: Iterable[Worker]) -> list[Worker]:
    """Wait until some of the workers have answered or died; returns those."""
    connections = {worker._connection: worker for worker in workers}
    ready = wait(connections)
    return [worker for connection, worker in connections.items() if connection in ready]


def end_workers(workers: Iterable[Worker]) -> None:
    """End the workers, whatever they do."""
    for worker in workers:
        worker.end()


def _serve(connection: Connection, make_server: Callable[[], Server]) -> None:
    """Answer requests until the other end of the connection is closed, or its process dead.

    Each answer is a pair: None and the answer, or what went wrong, in one line, and None;
    the worker ends after such a failure.
    """
    with contextlib.ExitStack() as stack:
        try:
            server = stack.enter_context(contextlib.closing(make_server()))
            for request in _requests(connection):
                connection.send((None, server(request)))
        except Exception as error:  # told before the server is closed, which may take long
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            with contextlib.suppress(OSError):  # nobody listens any more
                connection.send((reason, None))


def _requests(connection: Connection) -> Iterator[Any]:
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            yield connection.recv()


@contextlib.contextmanager
def _inherited() -> Iterator[None]:
    """For processes started meanwhile: no Ctrl-C, and one thread.

    Ctrl-C is held back here, not lost.
    """
    resource_tracker.ensure_running()  # it would let Ctrl-C through when it starts
    added = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
        signal.pthread_sigmask(signal.SIG_SETMASK, before)  # here a held one comes
