"""Programs killed at any time, and on a disk that is full, go on to the same files, byte for byte."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil
import pytest
from tiny_run import ARGUMENTS, results

REPOSITORY = Path(__file__).parents[2]
EVALUATION = (
    "eval.py", "--randomization", "full", "--stand-time", "0", "--episodes", "12", "--jobs", "2", "--results",
)  # fmt: skip


@pytest.fixture
def often(only_full, many):
    """How often in one test: a program takes seconds."""
    return range(many(0, 10))


def times_ten(count):
    """So many tests, each with other random times."""
    return pytest.mark.parametrize("rng", [np.random.default_rng(seed) for seed in range(count)])


def start(*words, cwd=None):
    return subprocess.Popen(
        [sys.executable, "-W", "ignore", *map(str, words)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def run(script, *words, cwd=None):
    """Exit code and what it complains of."""
    with start(REPOSITORY / script, *words, cwd=cwd) as process:
        _, said = process.communicate(timeout=600)
    return process.returncode, said


def kill(after, script, *words, cwd=None):
    """Kill a program after some time (s), and see that nothing of it is left."""
    with start(REPOSITORY / script, *words, cwd=cwd) as process:
        time.sleep(after)
        family = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGKILL)
    assert not psutil.wait_procs(family, timeout=60)[1]


class Whole(NamedTuple):
    """An evaluation that nothing stopped: its file, and how long it took (s)."""

    content: bytes
    duration: float


@pytest.fixture
def whole(only_full, tmp_path):
    file, begun = tmp_path / "whole.jsonl", time.monotonic()
    assert run(*EVALUATION, file)[0] == 0
    return Whole(file.read_bytes(), time.monotonic() - begun)


@pytest.mark.fault("killed evaluations")
@times_ten(10)
def test_an_evaluation_killed_at_any_time_is_finished(often, rng, whole, tmp_path):
    parts = tmp_path / "parts.jsonl"
    for _ in often:
        parts.unlink(missing_ok=True)
        kill(rng.uniform(0.0, whole.duration), *EVALUATION, parts)
        assert run(*EVALUATION, parts, "--resume")[0] == 0
        assert parts.read_bytes() == whole.content


@pytest.mark.fault("killed workers")
@times_ten(5)
def test_an_evaluation_whose_worker_is_killed_is_finished(often, rng, whole, tmp_path):
    parts = tmp_path / "parts.jsonl"
    for _ in often:
        parts.unlink(missing_ok=True)
        with start(REPOSITORY / "eval.py", *EVALUATION[1:], parts) as process:
            time.sleep(rng.uniform(0.0, whole.duration))
            workers = psutil.Process(process.pid).children(recursive=True)
            for worker in workers[-1:]:
                worker.kill()
            _, said = process.communicate(timeout=120)
        assert process.returncode in (0, 2)
        assert process.returncode == 0 or "died (exit code -9)" in said.splitlines()[-1]
        if process.returncode:
            assert run(*EVALUATION, parts, "--resume")[0] == 0
        assert parts.read_bytes() == whole.content


@pytest.mark.fault("killed trainings")
@times_ten(5)
def test_a_training_killed_at_any_time_is_finished(often, rng, tmp_path):
    pytest.importorskip("torch")
    whole, words = tmp_path / "whole", ("train.py", "--run", "run", *ARGUMENTS)
    whole.mkdir()
    begun = time.monotonic()
    assert run(*words, cwd=whole)[0] == 0
    duration = time.monotonic() - begun
    for number in often:
        folder = tmp_path / str(number)
        folder.mkdir()
        kill(rng.uniform(0.0, duration), *words, cwd=folder)
        again = (
            ("train.py", "--resume", "run")
            if (folder / "run" / "options.json").exists()
            else words
        )
        assert run(*again, cwd=folder)[0] == 0
        assert results(folder / "run") == results(whole / "run")


@pytest.mark.fault("full disk")
def test_a_full_disk_is_told_and_the_evaluation_finished(often, rng, tmp_path):
    whole, disk = tmp_path / "whole.jsonl", tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8k", "tmpfs", disk]).returncode:
        pytest.skip("no disk can be mounted here")
    try:
        assert run(*EVALUATION, whole)[0] == 0
        for _ in often:
            parts = disk / "parts.jsonl"
            parts.unlink(missing_ok=True)
            pages = rng.integers(1, 4)
            subprocess.run(["mount", "-o", f"remount,size={4 * pages}k", disk], check=True)
            code, said = run(*EVALUATION, parts)
            assert code == 2
            assert said.splitlines()[-1].startswith("error: [Errno 28] No space left on device")
            subprocess.run(["mount", "-o", "remount,size=1m", disk], check=True)
            assert run(*EVALUATION, parts, "--resume")[0] == 0
            assert parts.read_bytes() == whole.read_bytes()
    finally:
        subprocess.run(["umount", disk], check=True)
