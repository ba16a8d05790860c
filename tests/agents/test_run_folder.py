"""Two runs cannot write to one folder, and a dead one keeps nobody out."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from agents.run_folder import RunLockedError, lock_run

PROGRAM = """
import sys
from pathlib import Path

from agents.run_folder import lock_run

with lock_run(Path(sys.argv[1])):
    print("locked", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def run(tmp_path):
    """A run of another process, in the folder ``run``."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "run"],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "locked\n"
        yield process
        process.kill()


def is_locked_by(pid):
    message = f"run is in use by another run, process {pid}"
    return pytest.raises(RunLockedError, match=f"^{re.escape(message)}$")


def test_a_second_run_is_refused_until_the_first_has_ended(run):
    for _ in range(2):
        with is_locked_by(run.pid), lock_run(Path("run")):
            pass
    run.communicate()
    with lock_run(Path("run")):
        pass


def test_a_killed_run_leaves_no_lock(run):
    run.kill()
    run.wait()
    with lock_run(Path("run")):
        with is_locked_by(os.getpid()), lock_run(Path("run")):
            pass
        with lock_run(Path("another")):
            pass


def test_an_error_in_the_run_lifts_the_lock(tmp_path):
    with pytest.raises(ZeroDivisionError), lock_run(tmp_path / "new" / "run"):
        _ = 1 / 0
    with lock_run(tmp_path / "new" / "run"):
        pass


def test_the_lock_does_not_follow_a_link(tmp_path):
    precious, run = tmp_path / "precious.txt", tmp_path / "run"
    precious.write_text("do not touch")
    run.mkdir()
    (run / ".lock").symlink_to(precious)
    with pytest.raises(OSError, match=r"\.lock"), lock_run(run):
        pass
    assert precious.read_text() == "do not touch"
