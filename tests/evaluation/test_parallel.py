"""Episodes in worker processes: the same results, clean ends."""

import contextlib
import importlib.util
import ipaddress
import itertools
import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation import parallel
from icub_jump_env.evaluation.parallel import Job, WorkerError, run_jobs

REPOSITORY = Path(__file__).parents[2]

JUMP = JumpConfig(stand_time=0.0)
GROUNDED = JumpConfig(control_frequency=1.0, agent_frequency=1.0)
"""Too slow a controller to take off: most metrics are undefined."""
VARIED = JumpConfig(stand_time=0.0, randomization="full", sensors="realistic")

# Asked, not imported: run_jobs is to import it, with its settings.
needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="needs ray")


def episodes(config, count):
    return [Job(config, seed) for seed in range(count)]


def descendants(pid=None):
    return psutil.Process(pid).children(recursive=True)


def all_end(processes):
    return not psutil.wait_procs(processes, timeout=60)[1]


def test_one_job_runs_here_without_ray(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    before = descendants()
    results = dict(run_jobs(episodes(JUMP, 2), jobs=1))
    assert [results[index].seed for index in range(2)] == [0, 1]
    assert descendants() == before


def test_one_job_builds_an_environment_per_configuration(monkeypatch):
    built = []
    make_env = parallel.make_env
    monkeypatch.setattr(parallel, "make_env", lambda c: built.append(c) or make_env(c))
    assert len(list(run_jobs(episodes(JUMP, 2) + episodes(GROUNDED, 2), jobs=1))) == 4
    assert built == [JUMP, GROUNDED]


def test_no_work_starts_nothing(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert list(run_jobs([], jobs=4)) == []


def test_missing_ray_is_named_at_once(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match=r'-e "\.\[parallel\]"'):
        run_jobs(episodes(JUMP, 2), jobs=2)


@needs_ray
def test_results_do_not_depend_on_the_jobs(capfd):
    """Nor on the order and on the episodes that ran before, in a world that varies."""
    triples = zip(*(episodes(config, 3) for config in (JUMP, GROUNDED, VARIED)), strict=True)
    work = list(itertools.chain(*triples))
    alone = dict(run_jobs(work, jobs=1))
    before = set(descendants())
    together = dict(run_jobs(work[::-1], jobs=3))
    assert all_end(set(descendants()) - before)
    assert capfd.readouterr() == ("", "")

    assert sorted(alone) == list(range(len(work)))
    assert alone == {len(work) - 1 - index: episode for index, episode in together.items()}
    assert math.isnan(alone[1].jump["takeoff_time"])
    assert len({alone[index].jump["flight_height"] for index in (2, 5, 8)}) == 3


@needs_ray
def test_a_killed_worker_ends_the_run_with_one_error(capfd):
    before = set(descendants())
    results = run_jobs(episodes(JUMP, 1000), jobs=2)
    finished = [next(results) for _ in range(3)]
    started = set(descendants()) - before
    busy = []
    while not busy:
        busy = [process for process in started if process.name().startswith("ray::_run")]
    for process in busy:
        process.kill()
    with pytest.raises(WorkerError, match=r"^seed \d+ failed .*died.*$"):
        finished.extend(results)
    assert 3 <= len(finished) < 1000
    assert all_end(started)
    assert capfd.readouterr() == ("", "")


@needs_ray
def test_a_cluster_in_use_is_used_and_left_running():
    """Even one with fewer processors than jobs; and an error in a worker is named."""
    ray = parallel._import_ray()
    ray.init(
        "local",
        num_cpus=1,
        include_dashboard=False,
        log_to_driver=False,
        runtime_env={"env_vars": {"PYTHONPATH": str(REPOSITORY)}},
    )
    try:
        results = run_jobs([Job(JUMP, seed) for seed in (0, -1, 1)], jobs=2)
        with pytest.raises(WorkerError, match=r"seed -1 failed in its worker: ConfigError: seed"):
            list(results)
        with contextlib.closing(run_jobs(episodes(JUMP, 1000), jobs=2)) as results:
            assert next(results)[1].outcome == "stood"
        assert ray.is_initialized()
        assert len(dict(run_jobs(episodes(JUMP, 2), jobs=2))) == 2
    finally:
        ray.shutdown(wait_for_processes=True)


@needs_ray
def test_ray_that_does_not_start_is_named(monkeypatch):
    def refuse(*_, **__):
        raise ValueError("no\nroom")

    monkeypatch.setattr(parallel._import_ray(), "init", refuse)
    with pytest.raises(WorkerError, match=r"^Ray did not start: no room$"):
        next(run_jobs(episodes(JUMP, 2), jobs=2))


PROGRAM = """
import sys
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.parallel import Job, run_jobs

try:
    work = [Job(JumpConfig(stand_time=0.0), seed) for seed in range(10_000)]
    for number, _ in enumerate(run_jobs(work, jobs=2)):
        if number == 2:
            print("running", flush=True)
except KeyboardInterrupt:
    print("interrupted")
"""


@needs_ray
def test_an_interrupt_leaves_no_process_and_no_noise(tmp_path):
    """From a folder with another package of our name, which workers must not import."""
    script = tmp_path / "scripts" / "program.py"
    folder = tmp_path / "elsewhere"
    for file, text in ((script, PROGRAM), (folder / "icub_jump_env" / "__init__.py", "1 / 0")):
        file.parent.mkdir(parents=True)
        file.write_text(text)
    with subprocess.Popen(
        [sys.executable, str(script)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY), "HOME": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as program:
        assert program.stdout.readline() == "running\n"
        started = descendants(program.pid)
        sockets = [
            connection.laddr.ip
            for process in (psutil.Process(program.pid), *started)
            for connection in process.net_connections("inet")
            if connection.status == psutil.CONN_LISTEN
        ]
        os.killpg(program.pid, signal.SIGINT)
        assert program.communicate(timeout=120) == ("interrupted\n", "")
    assert all_end(started)
    assert sockets
    for address in map(ipaddress.ip_address, sockets):
        assert (getattr(address, "ipv4_mapped", None) or address).is_loopback
    assert not (tmp_path / ".ray").exists()
