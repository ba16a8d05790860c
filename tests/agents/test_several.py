"""Several trainings: each is the one that its seed alone would be, wherever it runs."""

import dataclasses
import json
import pickle
import shutil
from pathlib import Path

import pytest
from local_cluster import two_nodes
from tiny_run import ARGUMENTS, results, train

from agents import several, training
from agents.options import TrainOptions, read_options
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.cluster import OtherCodeError


def alike(folder):
    """What a run leaves, without the words of its command."""
    found = results(folder)
    for name in ("options.json", "best.json", "last.json"):
        found[name] = json.loads(found[name]) | {"command": None}
    return found


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The folder of a run with a single seed."""
    folder = tmp_path_factory.mktemp("alone")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert train(patch, "--seed", "3", "--run", "run", *ARGUMENTS) == 0
    return folder / "run"


def test_each_seed_has_its_training_and_folder():
    runs = TrainOptions(seeds="2..4", cluster="head:1").trainings
    assert runs == [TrainOptions(seed=seed) for seed in (2, 3, 4)]
    assert [str(run.folder) for run in runs] == [f"runs/velocity-seed{seed}" for seed in (2, 3, 4)]
    (run,) = TrainOptions(seeds="7..7", run=Path("runs/mine")).trainings
    assert (run.seed, str(run.folder)) == (7, "runs/mine-seed7")
    assert TrainOptions(seed=5, cluster="head:1").trainings == [TrainOptions(seed=5)]


@pytest.mark.parametrize(
    "seeds", ["", "3", "3..", "4..3", "0-4", "-1..2", "0..4294967296", "0..\u0661"]
)
def test_what_is_no_range_of_seeds_is_refused(seeds):
    with pytest.raises(ConfigError, match=r"such as 0\.\.4"):
        TrainOptions(seeds=seeds)


@pytest.mark.parametrize("other", [{"seed": 1}, {"resume": Path("run")}])
def test_a_range_goes_with_no_other_seed_and_needs_no_resume(other):
    with pytest.raises(ConfigError, match="not with --seeds"):
        TrainOptions(seeds="0..4", **other)


def test_where_it_runs_is_no_part_of_a_run():
    assert TrainOptions(cluster="head:1", seeds="0..0").as_dict() == TrainOptions().as_dict()


def test_one_after_the_other_and_on_with_the_interrupted(alone, monkeypatch, capsys):
    """Of the first run there is a part, of the second nothing."""
    words = ("--seeds", "3..4", "--run", "run", *ARGUMENTS)

    def interrupted(folder, model, number, progress):
        save_checkpoint(folder, model, number, progress)
        if number == 2:
            raise KeyboardInterrupt

    save_checkpoint = training.save_checkpoint
    with monkeypatch.context() as patch:
        patch.setattr(training, "save_checkpoint", interrupted)
        assert train(monkeypatch, *words) == 130
    assert "the same command goes on\n" in capsys.readouterr().err
    assert not Path("run-seed4").exists()
    assert train(monkeypatch, *words) == 0
    assert alike(Path("run-seed3")) == alike(alone)
    assert json.loads(Path("run-seed4/options.json").read_text())["seed"] == 4
    assert len(json.loads(Path("run-seed4/curve.json").read_text())["evaluations"]) == 4

    capsys.readouterr()
    assert train(monkeypatch, *words) == 0
    assert capsys.readouterr().err.count(" is finished\n") == 2


class TestOnANode:
    def snapshots(self, folder):
        run = dataclasses.replace(read_options(folder / "options.json"), resume=folder)
        asked = pickle.dumps((run, several._files(folder)))
        return several._train_on_node(several._fingerprint(), asked)

    @pytest.fixture
    def begun(self, alone):
        """What the process that asks has: a claimed folder."""
        folder = Path("begun")
        folder.mkdir()
        shutil.copy(alone / "options.json", folder)
        return folder

    def test_the_folder_follows_and_ends_as_that_of_a_run_here(self, alone, begun):
        found = list(self.snapshots(begun))
        steps = [point["timesteps"] for point in curve(alone)]
        assert [snapshot.timesteps for snapshot in found] == [*steps, steps[-1]]
        assert found[0].said[0] == "no checkpoint in begun: starting from step 0"
        assert [line.split(" steps: ")[0] for s in found[:-1] for line in s.said[-1:]] == [
            str(step) for step in steps
        ]
        assert found[-1].said[-1] == "wrote begun/best.safetensors"
        for snapshot in found:
            several._write(begun, snapshot.files)
        assert alike(begun) == {k: v for k, v in alike(alone).items() if k != ".lock"}

    def test_it_goes_on_from_any_snapshot(self, alone, begun):
        """As after the process that asked was interrupted."""
        stream = self.snapshots(begun)
        for snapshot in (next(stream), next(stream)):
            several._write(begun, snapshot.files)
        *_, last = self.snapshots(begun)
        several._write(begun, last.files)
        assert alike(begun) == {k: v for k, v in alike(alone).items() if k != ".lock"}

    def test_an_error_ends_the_stream(self, begun):
        (begun / "options.json").write_text("{")
        asked = pickle.dumps((TrainOptions(resume=begun), several._files(begun)))
        with pytest.raises(ConfigError, match="a JSON file"):
            list(several._train_on_node(several._fingerprint(), asked))

    def test_other_code_is_refused(self, begun):
        other = {**several._fingerprint(), "agents": "other"}
        with pytest.raises(OtherCodeError, match=r"agents \(.*, not other\)"):
            next(several._train_on_node(other, b""))


def curve(folder):
    return json.loads((folder / "curve.json").read_text())["evaluations"]


@pytest.mark.fault("lost cluster nodes")
def test_a_node_lost_midway_changes_nothing(monkeypatch, capsys):
    pytest.importorskip("ray")
    short = ["--seeds", "0..1", "--stand-time", "0.0", "--jobs", "2", "--timesteps", "1"]
    short += ["--ppo.episodes", "2", "--ppo.hidden", "8", "--evaluation-episodes", "2"]
    assert train(monkeypatch, *short, "--run", "here") == 0
    with two_nodes() as (address, kill_second):
        write, written = several._write, []

        def killing(folder, files):
            write(folder, files)
            if not written:
                kill_second()
            written.append(folder)

        monkeypatch.setattr(several, "_write", killing)
        capsys.readouterr()
        assert train(monkeypatch, *short, "--run", "there", "--cluster", address) == 0
    err = capsys.readouterr().err
    for seed in (0, 1):
        assert f"there-seed{seed}: wrote there-seed{seed}/best.safetensors\n" in err
        assert alike(Path(f"there-seed{seed}")) == alike(Path(f"here-seed{seed}"))
