"""Worker processes, whatever happens around them."""

import multiprocessing
import os
import signal
from multiprocessing.context import SpawnProcess

import pytest

from icub_jump_env.workers import start_workers


class Echo:
    def __call__(self, request):
        return request

    def close(self):
        pass


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT for oneself")
def test_ctrl_c_while_workers_start_leaves_none(monkeypatch):
    start, started = SpawnProcess.start, []

    def start_and_interrupt(process):
        start(process)
        started.append(process)
        if len(started) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(SpawnProcess, "start", start_and_interrupt)
    with pytest.raises(KeyboardInterrupt):
        start_workers([Echo] * 3)
    assert len(started) == 2
    assert multiprocessing.active_children() == []
