"""Episodes on a Ray cluster: the same results, even if a node dies."""

import contextlib
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import psutil
import pytest
from contenders import evaluate
from local_cluster import two_nodes

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.evaluation.episodes import cluster as cluster_module
from icub_jump_env.evaluation.episodes.cluster import Cluster, OtherCodeError
from icub_jump_env.evaluation.episodes.parallel import Job, run_jobs
from icub_jump_env.workers import THREADS, WorkerError

REPOSITORY = Path(__file__).parents[2]

VARIED = JumpConfig.of(stand_time=0.0, randomization="full", sensors="realistic")
NOWHERE = "127.0.0.1:1"
"""Nothing listens there."""


@pytest.fixture(scope="module")
def nodes():
    with two_nodes() as nodes:
        yield nodes


@pytest.fixture
def cluster(nodes):
    return Cluster(nodes[0])


def test_an_address_without_a_cluster_is_named_before_anything_is_written(capsys):
    """First, as this process joins a cluster later."""
    pytest.importorskip("ray")
    code, out, err = evaluate(capsys, "--episodes", 2, "--cluster", NOWHERE)
    assert (code, out) == (2, "")
    assert err == f"error: no cluster at {NOWHERE}: [Errno 111] Connection refused\n"
    assert not list(Path().iterdir())


def test_half_a_log_is_finished_on_the_cluster_to_the_same_bits(cluster, capsys):
    asked = ("--episodes", 6, "--randomization", "full", "--stand-time", 0.0)
    local = evaluate(capsys, *asked, "--results", "local.jsonl")
    lines = Path("local.jsonl").read_text().splitlines(keepends=True)
    assert len(lines) == 7
    Path("half.jsonl").write_text("".join(lines[:3]))
    where = ("--cluster", cluster.address, "--resume", "--results", "half.jsonl")
    code, out, err = evaluate(capsys, *asked, *where)
    assert (code, out) == local[:2]
    assert err == "wrote half.jsonl\n"
    assert Path("half.jsonl").read_bytes() == Path("local.jsonl").read_bytes()


def test_a_worker_has_one_thread(cluster):
    with cluster.slots(partial(partial, os.getenv), len(THREADS)) as slots:
        for slot, name in zip(slots, THREADS, strict=True):
            slot.send(name)
        assert [slot.recv() for slot in slots] == ["1"] * len(THREADS)


def test_an_error_in_a_worker_is_named_with_its_seed(cluster, capfd):
    problem = r"^seed -1: a worker of the cluster failed: ConfigError: seed=-1 "
    with pytest.raises(WorkerError, match=problem):
        list(run_jobs([Job(VARIED, -1)], cluster))
    assert capfd.readouterr() == ("", "")


def test_a_run_given_up_frees_the_processors(cluster):
    long = JumpConfig.of(stand_time=20.0, success={"stand_time": 20.0})
    work = [Job(VARIED, 0), *(Job(long, seed) for seed in range(100))]
    with contextlib.closing(run_jobs(work, cluster)) as results:
        assert next(results)[0] == 0
    (episode,) = dict(run_jobs([Job(VARIED, 3)], cluster)).values()
    assert episode.seed == 3


def test_other_code_is_refused_with_what_differs(cluster, monkeypatch, capsys):
    monkeypatch.setattr(cluster_module, "fingerprint", lambda: {"icub_jump_env": "other"})
    with pytest.raises(
        OtherCodeError, match=r"has other code .*: icub_jump_env \(.*, not other\)"
    ):
        list(run_jobs([Job(VARIED, 0)], cluster))
    code, out, err = evaluate(capsys, "--episodes", 2, "--cluster", cluster.address)
    assert (code, out) == (2, "")
    assert err.splitlines()[-1].startswith("error: node ")


@pytest.mark.fault("killed workers")
def test_a_worker_of_a_node_killed_at_any_time_changes_nothing(nodes, many, rng, capsys):
    asked = ("--episodes", "6", "--randomization", "full", "--seed", "40", "--results")
    code, out, _ = evaluate(capsys, *asked, "local.jsonl")
    assert code == 0
    for number in range(many(1, 30)):
        log = f"{number}.jsonl"
        words = [REPOSITORY / "eval.py", *asked, log, "--cluster", nodes[0]]
        with subprocess.Popen(
            [sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as run:
            busy = []
            while run.poll() is None and not (busy := busy_workers()):
                time.sleep(0.02)
            time.sleep(rng.uniform(0.0, 1.0))
            assert busy
            with contextlib.suppress(psutil.NoSuchProcess):
                busy[0].kill()
            assert run.communicate() == (out, f"wrote {log}\n")
        assert run.returncode == 0
        assert Path(log).read_bytes() == Path("local.jsonl").read_bytes()


def busy_workers():
    """Processes of the nodes that answer a request."""
    found = []
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if process.cmdline()[:1] == ["ray::_answer"]:
                found.append(process)
    return found


@pytest.mark.fault("lost cluster nodes")
def test_a_node_lost_midway_changes_nothing(nodes, capsys):
    """Nor is anything said of it. Last, as a node is missing afterwards."""
    asked = ("--episodes", "6", "--randomization", "full", "--seed", "40", "--results")
    code, out, _ = evaluate(capsys, *asked, "local.jsonl")
    assert code == 0
    words = [REPOSITORY / "eval.py", *asked, "log.jsonl", "--cluster", nodes[0]]
    with subprocess.Popen(
        [sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        log = Path("log.jsonl")
        while run.poll() is None and not (log.exists() and log.read_bytes().count(b"\n") > 1):
            time.sleep(0.02)
        nodes[1]()
        assert run.communicate() == (out, "wrote log.jsonl\n")
    assert run.returncode == 0
    assert log.read_bytes() == Path("local.jsonl").read_bytes()


def test_without_ray_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match=r"the extra 'cluster'.*\[cluster\]"):
        list(run_jobs([Job(VARIED, 0)], Cluster(NOWHERE)))


def test_plans_of_ones_own_are_refused():
    config = JumpConfig.of(planner="whole_body")
    object.__setattr__(config, "plans", "mine.safetensors")
    with pytest.raises(ConfigError, match=r"plans='mine.safetensors' .*the shipped ones"):
        list(run_jobs([Job(config, 0)], Cluster(NOWHERE)))


@pytest.mark.parametrize("address", ["", "head", "head:", ":6379", "head:0", "head:65536"])
def test_an_address_is_a_host_and_a_port(address):
    with pytest.raises(ConfigError, match="HOST:PORT"):
        Cluster(address)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--cluster", NOWHERE], "a single jump"),
        (["--cluster", NOWHERE, "--sweep", "--jobs", "2"], "jobs=2 is not allowed: not with --cluster"),
        (["--cluster", NOWHERE, "--view"], "not with --view"),
    ],
)  # fmt: skip
def test_what_does_not_go_with_a_cluster_is_refused(capsys, arguments, words):
    code, out, err = evaluate(capsys, *arguments)
    assert (code, out) == (2, "")
    assert words in err


def test_without_a_cluster_ray_is_not_imported():
    program = (
        "import sys\n"
        "from icub_jump_env.config import JumpConfig\n"
        "from icub_jump_env.evaluation.episodes.parallel import Job, run_jobs\n"
        "list(run_jobs([Job(JumpConfig.of(stand_time=0.0), 0)], 1))\n"
        "assert 'ray' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
