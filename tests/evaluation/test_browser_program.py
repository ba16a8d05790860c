"""Programs that show a jump in the browser, and how they and the page end."""

import contextlib
import os
import signal
import subprocess
import sys

import psutil
import pytest
from shows import PATIENCE, get

PROGRAM = """
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.modes import view
from rich.console import Console

view.in_browser = lambda: True
"""
HANGING = """
import careless_pages
from icub_jump_env.simulation.viewers import browser

browser.Page = careless_pages.HangingPage
"""
SHOW = "view.view(JumpConfig(), 0, Console())"
GUARDED = f"if __name__ == '__main__':\n    {SHOW}\n"


@contextlib.contextmanager
def program(text, folder):
    """A running program that shows a jump."""
    pytest.importorskip("icub_jump_env.simulation.viewers.browser")
    file = folder / "program.py"
    file.write_text(PROGRAM + text)
    environment = os.environ | {"PYTHONUNBUFFERED": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, file],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.fault("killed workers")
def test_the_page_ends_with_its_program(tmp_path):
    with program(HANGING + GUARDED, tmp_path) as process:
        assert process.stdout.readline().startswith("open ")
        children = psutil.Process(process.pid).children()
        process.kill()
        assert psutil.wait_procs(children, PATIENCE)[1] == []


def test_an_unguarded_program_is_told_why_it_shows_nothing(tmp_path):
    with program(SHOW, tmp_path) as process:
        _, complaint = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "if __name__ == '__main__'" in complaint
    assert "WorkerError: the live view died (exit code 1)" in complaint


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a child alone")
def test_ctrl_c_ends_the_show_without_a_complaint(tmp_path):
    with program(f"{GUARDED}    print('ended')\n", tmp_path) as process:
        address, keys = process.stdout.readline(), process.stdout.readline()
        assert get(address.split()[1])[0] == 200
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert "Backspace: replay" in keys
    assert (process.returncode, out, err) == (0, "ended\n", "")
