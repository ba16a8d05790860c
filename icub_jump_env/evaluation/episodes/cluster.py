"""Requests on a Ray cluster: whichever processor is free answers the next one.

What is on a node is not sent there: a node has the package installed, and each request first
checks that it is the same as here. Ray repeats a request whose node is lost.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import logging
import os
import pickle
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, ICubJumpError, MissingDependencyError
from icub_jump_env.evaluation.report.provenance import content, versions
from icub_jump_env.workers import THREADS, Server, WorkerError

if TYPE_CHECKING:
    import ray

RETRIES = 5
"""How often a request whose node or process died is repeated: not for ever, as it may be the cause."""

_PATIENCE = 10.0
"""How long (s) the head may take to accept a connection; Ray itself would try for minutes."""


class ClusterError(ICubJumpError, RuntimeError):
    """There is no cluster at an address, it cannot be joined, or has no processors."""


class LostError(WorkerError):
    """The process of a task died, or its node did."""


class OtherCodeError(ClusterError):
    """A node has other code or other versions of packages than this process."""


@dataclass(frozen=True)
class Cluster:
    """A Ray cluster, of which this machine is a node.

    Attributes:
        address: Of its head: host and port.

    Raises:
        ConfigError: If it is no such address.
    """

    address: str

    def __post_init__(self) -> None:
        host, _, port = self.address.rpartition(":")
        if not host or not port.isdecimal() or not 0 < int(port) < 2**16:
            raise ConfigError("cluster", self.address, "HOST:PORT, such as 10.0.0.1:6379")

    def connect(self) -> None:
        """Join the cluster until this process ends, unless it has joined one.

        Raises:
            MissingDependencyError: If Ray is missing.
            ClusterError: If nothing answers there, or Ray cannot join.
        """
        # Read when Ray is imported: else the loss of a node is announced on stdout.
        os.environ.setdefault("RAY_DEDUP_LOGS_SKIP_REGEX", ".*")
        try:
            import ray
        except ImportError as error:
            raise MissingDependencyError.of_extra("a cluster", "cluster") from error
        if ray.is_initialized():
            return
        host, _, port = self.address.rpartition(":")
        try:
            socket.create_connection((host, int(port)), _PATIENCE).close()
        except OSError as error:
            raise ClusterError(f"no cluster at {self.address}: {error}") from error
        with _own_sigterm():
            try:
                ray.init(
                    address=self.address,
                    log_to_driver=False,
                    logging_level=logging.CRITICAL,
                    # As in a local worker: one, unless the user said else.
                    runtime_env={
                        "env_vars": {name: os.environ.get(name, "1") for name in THREADS}
                    },
                )
            except Exception as error:  # whatever Ray meets there
                raise ClusterError(
                    f"cannot join the cluster at {self.address}: {error}"
                ) from error

    @contextlib.contextmanager
    def slots(self, make_server: Callable[[], Server], requests: int) -> Iterator[list[Slot]]:
        """Slots that keep all processors busy, once the cluster is joined.

        What they hold at the end is given up.

        Args:
            make_server: Builds what answers, once in each process of the cluster. Must be
                picklable.
            requests: How many there are to come.

        Raises:
            As :meth:`connect`.
        """
        self.connect()
        import ray

        processors = int(ray.cluster_resources().get("CPU", 0))
        if processors < 1:
            raise ClusterError(f"the cluster at {self.address} has no processors")
        # Two for each: the next request waits there, not here.
        slots = [Slot(make_server) for _ in range(min(2 * processors, requests))]
        try:
            yield slots
        finally:
            for slot in slots:
                slot.give_up()


Jobs = int | Cluster
"""Number of worker processes on this machine, or a cluster, all of whose processors work."""


class Slot:
    """Holds one request at a time; the counterpart of a local worker."""

    def __init__(self, make_server: Callable[[], Server]) -> None:
        self._make_server = make_server
        self._task: ray.ObjectRef[Any] | None = None

    def send(self, request: Any) -> None:
        """Hand over a request."""
        asked = pickle.dumps((self._make_server, request))
        self._task = remote(_answer, 1, RETRIES).remote(fingerprint(), asked)

    def recv(self) -> Any:
        """Wait for the answer.

        Raises:
            OtherCodeError: If it would come from other code.
            WorkerError: If a worker meets an error, or dies again and again.
        """
        assert self._task is not None  # a request was sent
        task, self._task = self._task, None
        return fetch(task)

    def give_up(self) -> None:
        """Stop the work at the request, if there is one."""
        if self._task is not None:
            give_up(self._task)

    @staticmethod
    def wait_for_any(slots: Iterable[Slot]) -> list[Slot]:
        """Wait until some of the slots have an answer or an error; returns those."""
        import ray

        waiting = {slot._task: slot for slot in slots}
        tasks = list(waiting)
        ray.wait(tasks, num_returns=1)
        # All that are ready: with hundreds of slots, one call for each would be too slow.
        ready, _ = ray.wait(tasks, num_returns=len(tasks), timeout=0)
        return [waiting[task] for task in ready]


@functools.cache  # else Ray would send the function to the nodes again and again
def remote(function: Callable[..., Any], cpus: int, retries: int) -> Any:
    """A function that runs on the cluster.

    Args:
        function: What runs.
        cpus: How many processors of a node it takes up.
        retries: How often Ray begins again where it was lost.
    """
    import ray

    return ray.remote(num_cpus=cpus, max_retries=retries)(function)


def fetch(task: ray.ObjectRef[Any]) -> Any:
    """The result of a task on the cluster.

    Raises:
        OtherCodeError: If it would come from other code.
        WorkerError: If the task meets an error.
        LostError: If its process died, each time that Ray tried.
    """
    import ray

    try:
        return ray.get(task)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, OtherCodeError):
            raise error.cause from None
        reason = f"{type(error.cause).__name__}: {error.cause}"
        raise WorkerError(f"a worker of the cluster failed: {reason}") from error
    except ray.exceptions.RayError as error:
        raise LostError(f"a worker of the cluster died: {error}") from error


def give_up(task: Any) -> None:
    """End a task on the cluster, whatever it does."""
    import ray

    ray.cancel(task, force=True)


@functools.cache
def fingerprint(
    modules: tuple[str, ...] = ("icub_jump_env",), packages: tuple[str, ...] = ()
) -> Mapping[str, str]:
    """What the bits of a result depend on besides the request, and the processor.

    Args:
        modules: Packages of ours, of which all code and data count.
        packages: Others whose version counts, besides the usual.
    """
    found = {
        module: content(Path(str(importlib.import_module(module).__file__)).parent)
        for module in modules
    }
    return found | versions("numba", *packages)


def check_same(ours: Mapping[str, str], theirs: Mapping[str, str]) -> None:
    """Refuse to work where something else is installed.

    Args:
        ours: The :func:`fingerprint` here, on a node.
        theirs: That of the process that asked.

    Raises:
        OtherCodeError: If they differ.
    """
    differing = [name for name in theirs if ours.get(name) != theirs[name]]
    if differing:
        told = ", ".join(f"{name} ({ours.get(name)}, not {theirs[name]})" for name in differing)
        raise OtherCodeError(f"node {socket.gethostname()} has other code or versions: {told}")


def check_plans(config: JumpConfig) -> None:
    """Refuse plans in a file of one's own, which a node need not have.

    Raises:
        ConfigError: If it names some.
    """
    if config.plans is not None:
        raise ConfigError(
            "plans", str(config.plans), "not on a cluster, which has the shipped ones"
        )


def _answer(theirs: Mapping[str, str], asked: bytes) -> Any:
    """Answer a request, in a process of a node; unpickled only where the code is the same."""
    check_same(fingerprint(), theirs)
    make_server, request = pickle.loads(asked)
    return _server(make_server)(request)


@functools.cache
def _server(make_server: Callable[[], Server]) -> Server:
    """The server of this process, which answers its next requests as well."""
    return make_server()


@contextlib.contextmanager
def _own_sigterm() -> Iterator[None]:
    """Take back SIGTERM, which Ray catches when it starts, in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
