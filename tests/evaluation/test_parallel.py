"""Episodes in worker processes: the same results, clean ends."""

import contextlib
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
from icub_jump_env.evaluation.episodes import parallel
from icub_jump_env.evaluation.episodes.parallel import Job, run_all, run_jobs
from icub_jump_env.workers import WorkerError

REPOSITORY = Path(__file__).parents[2]

JUMP = JumpConfig.of(stand_time=0.0)
GROUNDED = JumpConfig.of(control_frequency=1.0, agent_frequency=1.0)
"""Too slow a controller to take off: most metrics are undefined."""
VARIED = JumpConfig.of(stand_time=0.0, randomization="full", sensors="realistic")


def episodes(config, count):
    return [Job(config, seed) for seed in range(count)]


def workers(pid=None):
    """Processes of workers, without Python's resource tracker."""
    children = psutil.Process(pid).children(recursive=True)
    return {child for child in children if "spawn_main" in " ".join(child.cmdline())}


def all_end(processes):
    return not psutil.wait_procs(processes, timeout=60)[1]


@pytest.mark.parametrize("work", [episodes(JUMP, 2), []])
def test_one_job_or_none_starts_no_process(monkeypatch, work):
    monkeypatch.setattr(parallel, "start_workers", lambda _: pytest.fail("no workers"))
    results = dict(run_jobs(work, jobs=1 if work else 4))
    assert [results[index].seed for index in range(len(work))] == [job.seed for job in work]


def test_one_job_builds_an_environment_per_configuration(monkeypatch):
    built = []
    make_env = parallel.make_env
    monkeypatch.setattr(parallel, "make_env", lambda c: built.append(c) or make_env(c))
    assert len(list(run_jobs(episodes(JUMP, 2) + episodes(GROUNDED, 2), jobs=1))) == 4
    assert built == [JUMP, GROUNDED]


def test_results_do_not_depend_on_the_jobs(capfd):
    """Nor on the order and on the episodes that ran before, in a world that varies."""
    triples = zip(*(episodes(config, 3) for config in (JUMP, GROUNDED, VARIED)), strict=True)
    work = list(itertools.chain(*triples))
    alone = dict(run_jobs(work, jobs=1))
    together = dict(run_jobs(work[::-1], jobs=3))
    assert not workers()
    assert capfd.readouterr() == ("", "")

    assert sorted(alone) == list(range(len(work)))
    assert alone == {len(work) - 1 - index: episode for index, episode in together.items()}
    assert math.isnan(alone[1].jump["takeoff_time"])
    assert len({alone[index].jump["flight_height"] for index in (2, 5, 8)}) == 3


def test_results_come_in_the_order_of_the_work(quiet):
    """The first one takes longest."""
    work = [Job(JumpConfig.of(stand_time=3.0), 7), *episodes(JUMP, 3)]
    assert [episode.seed for episode in run_all(work, 2, quiet)] == [7, 0, 1, 2]


@pytest.mark.fault("killed workers")
def test_a_killed_worker_ends_the_run_with_one_error(capfd):
    results = run_jobs(episodes(JUMP, 1000), jobs=2)
    finished = [next(results) for _ in range(3)]
    for process in workers():
        process.kill()
    with pytest.raises(WorkerError, match=r"^seed \d+: worker [01] died \(exit code -9\)$"):
        finished.extend(results)
    assert 3 <= len(finished) < 1000
    assert not workers()
    assert capfd.readouterr() == ("", "")


def test_an_error_in_a_worker_is_named_with_its_seed(capfd):
    """Jobs left over are not run, and those that were are kept."""
    results = run_jobs([Job(JUMP, seed) for seed in (0, -1, 1)], jobs=2)
    with pytest.raises(WorkerError, match=r"^seed -1: worker 1 failed: ConfigError: seed=-1 "):
        list(results)
    assert not workers()
    assert capfd.readouterr() == ("", "")


def test_a_run_given_up_leaves_no_process():
    with contextlib.closing(run_jobs(episodes(JUMP, 1000), jobs=2)) as results:
        assert next(results)[1].outcome == "stood"
        assert len(workers()) == 2
    assert not workers()


PROGRAM = """
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.parallel import Job, run_jobs

if __name__ == "__main__":
    try:
        work = [Job(JumpConfig.of(stand_time=0.0), seed) for seed in range(10_000)]
        for number, _ in enumerate(run_jobs(work, jobs=2)):
            if number == 2:
                print("running", flush=True)
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.fixture
def program(tmp_path):
    """From a folder with another package of our name, which workers must not import."""
    script = tmp_path / "scripts" / "program.py"
    folder = tmp_path / "elsewhere"
    for file, text in ((script, PROGRAM), (folder / "icub_jump_env" / "__init__.py", "1 / 0")):
        file.parent.mkdir(parents=True)
        file.write_text(text)
    with subprocess.Popen(
        [sys.executable, str(script)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as program:
        assert program.stdout.readline() == "running\n"
        yield program
        program.kill()


def test_ctrl_c_leaves_no_process_and_no_noise(program):
    """A terminal sends it to all of them."""
    started = workers(program.pid)
    assert len(started) == 2
    os.killpg(program.pid, signal.SIGINT)
    assert program.communicate(timeout=60) == ("interrupted\n", "")
    assert all_end(started)


@pytest.mark.fault("killed workers")
def test_a_killed_run_leaves_no_process(program):
    started = workers(program.pid)
    assert len(started) == 2
    program.kill()
    assert all_end(started)
    assert program.communicate(timeout=60) == ("", "")
