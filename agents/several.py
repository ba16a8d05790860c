"""Several trainings: one after the other here, or side by side on a cluster."""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import io
import pickle
import tempfile
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn

from icub_jump_env.evaluation.episodes.cluster import (
    RETRIES,
    Cluster,
    LostError,
    check_plans,
    check_same,
    fetch,
    fingerprint,
    give_up,
    remote,
)
from icub_jump_env.evaluation.report.output import progress_display, say
from icub_jump_env.files import write_files
from icub_jump_env.workers import WorkerError

from .options import OPTIONS, TrainOptions
from .training import PACKAGES, claimed, train


@dataclass(frozen=True)
class Snapshot:
    """A run on a node, as it was right after a checkpoint.

    Attributes:
        timesteps: Steps so far.
        said: Lines that were reported since the one before.
        files: Content of its folder, by relative path.
    """

    timesteps: int
    said: list[str]
    files: dict[str, bytes]


def train_several(options: TrainOptions, console: Console) -> None:
    """Train with every seed; the same call goes on with runs that were interrupted.

    Args:
        options: What to train, and where.
        console: Where to report.

    Raises:
        As :func:`~.training.train`, and as :meth:`Cluster.connect`.
    """
    runs = [_going_on(run) for run in options.trainings]
    if options.cluster is not None:
        _train_on_cluster(runs, Cluster(options.cluster), console)
        return
    for run in runs:
        say(console, f"run {run.folder}")
        train(run, console)


def _going_on(run: TrainOptions) -> TrainOptions:
    """A run, resumed if its folder holds one."""
    if not (run.folder / OPTIONS).exists():
        return run
    return dataclasses.replace(run, run=None, resume=run.folder)


def _train_on_cluster(runs: list[TrainOptions], cluster: Cluster, console: Console) -> None:
    """Train side by side; each run's folder here follows the one on its node."""
    cluster.connect()
    import ray

    columns = TextColumn("learning"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    streams: dict[Any, TrainOptions] = {}
    with contextlib.ExitStack() as stack:
        for run in runs:
            check_plans(run.env)
            stack.enter_context(claimed(run, console))
        display = stack.enter_context(progress_display(console, *columns))
        task = display.add_task("learning", total=sum(run.timesteps for run in runs))
        done = dict.fromkeys((run.folder for run in runs), 0)
        lost: collections.Counter[Path] = collections.Counter()
        try:
            for run in runs:
                streams[_begin(run)] = run
            while streams:
                (stream,), _ = ray.wait(list(streams), num_returns=1)
                run = streams[stream]
                try:
                    snapshot: Snapshot = fetch(next(stream))
                except StopIteration:
                    del streams[stream]
                    continue
                except WorkerError as error:
                    lost[run.folder] += 1
                    if isinstance(error, LostError) and lost[run.folder] <= RETRIES:
                        streams[_begin(run)] = streams.pop(stream)
                        continue
                    raise WorkerError(f"{run.folder}: {error}") from error
                _write(run.folder, snapshot.files)
                for line in snapshot.said:
                    say(console, f"{run.folder}: {line}")
                done[run.folder] = snapshot.timesteps
                display.update(task, completed=sum(done.values()))
        finally:
            for stream in streams:
                give_up(stream)


def _begin(run: TrainOptions) -> Any:
    """The stream of snapshots of a training that begins, or goes on from the files here."""
    # Ray would begin again with the files of now, not with those of the latest checkpoint.
    task = remote(_train_on_node, min(run.jobs, _largest_node()), retries=0)
    return task.remote(_fingerprint(), pickle.dumps((run, _files(run.folder))))


def _largest_node() -> int:
    """Processors of the largest node of the cluster that is joined."""
    import ray

    return int(max(node["Resources"].get("CPU", 1) for node in ray.nodes() if node["Alive"]))


def _fingerprint() -> Mapping[str, str]:
    return fingerprint(("icub_jump_env", __name__.rpartition(".")[0]), PACKAGES)


def _train_on_node(theirs: Mapping[str, str], asked: bytes) -> Iterator[Snapshot]:
    """Train in a process of a node.

    Args:
        theirs: The :func:`fingerprint` where it was asked for.
        asked: Pickled: the options of a run that has been claimed, and its files.

    Yields:
        A snapshot for each checkpoint, and one at the end.
    """
    check_same(_fingerprint(), theirs)
    run, files = pickle.loads(asked)
    snapshots: SimpleQueue[Snapshot | BaseException | None] = SimpleQueue()
    with tempfile.TemporaryDirectory() as name:
        folder, report, said = Path(name), io.StringIO(), 0
        _write(folder, files)

        def note(timesteps: int) -> None:
            nonlocal said
            text = report.getvalue()
            lines = text[said:].replace(name, str(run.folder)).splitlines()
            said = len(text)
            snapshots.put(Snapshot(timesteps, lines, _files(folder)))

        def learn() -> None:
            try:
                resumed = dataclasses.replace(run, run=None, resume=folder)
                note(train(resumed, Console(file=report), note))
                snapshots.put(None)
            except BaseException as error:
                snapshots.put(error)

        # Stable-Baselines3 calls back, and Ray wants a generator. No reason to live on when
        # the task is given up.
        threading.Thread(target=learn, daemon=True).start()
        while (snapshot := snapshots.get()) is not None:
            if isinstance(snapshot, BaseException):
                raise snapshot
            yield snapshot


def _files(folder: Path) -> dict[str, bytes]:
    """Content of a run's folder, by relative path, without the lock."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    """Make a run's folder hold these files, and no other checkpoints and records of steps."""
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    write_files({folder / name: content for name, content in files.items()})
    for path in (*folder.glob("checkpoint-*"), *folder.glob("tensorboard/*")):
        if path.relative_to(folder).as_posix() not in files:
            path.unlink()  # older, or of an attempt that was lost with its node
