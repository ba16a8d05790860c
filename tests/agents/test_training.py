"""A training run: it starts at the baseline, and however it is stopped it ends the same."""

import errno
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.progress import TimeRemainingColumn
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tiny_run import ARGUMENTS, SEEDS, children, results, train, written

from agents import training
from agents.checkpoints import CheckpointError, load_latest
from agents.curve import check_progress
from agents.environment import acting_steps
from agents.options import read_options
from agents.training import MOST_CHECKPOINTS
from agents.vec_env import JumpVecEnv
from icub_jump_env.carded import MAX_CARD_SIZE
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.files import strict_json
from icub_jump_env.policy import load_policy

RUN = Path("run")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that nothing stopped."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        before = children()
        assert train(patch, "--run", "run", *ARGUMENTS) == 0
        assert children() == before
    return folder / "run"


@pytest.fixture
def finished(whole):
    """A copy of it, to be spoilt."""
    shutil.copytree(whole, RUN)


def curve(folder):
    return json.loads((folder / "curve.json").read_text())


def test_a_run_leaves_its_options_policies_curve_and_checkpoints(whole):
    assert set(results(whole)) == {
        ".lock",
        "options.json",
        "curve.json",
        *(f"{name}.{suffix}" for name in ("best", "last", "checkpoint-000003", "checkpoint-000004")
          for suffix in ("json", "safetensors")),
    }  # fmt: skip
    rollout = 2 * acting_steps(read_options(whole / "options.json").env)
    content = curve(whole)
    points = content["evaluations"]
    assert [point["timesteps"] for point in points] == [i * rollout for i in range(4)]
    assert len(content["minutes"]) == 4
    assert min(content["minutes"]) > 0
    assert np.shape(content["episode_seeds"]) == (3, 2)
    assert content["evaluation_seeds"] == [SEEDS.start, SEEDS.stop]
    # The first update was the value function's; then the policy learned, too.
    without_steps = [point | {"timesteps": 0} for point in points]
    assert without_steps[0] == without_steps[1] != without_steps[2] != without_steps[3]


def test_the_first_evaluation_is_the_baselines_bit_for_bit(whole):
    env = make_env(read_options(whole / "options.json").env)
    baseline = [run_episode(env, seed) for seed in SEEDS]
    first, summary = curve(whole)["evaluations"][0], Summary.of(baseline)
    assert first["score"] == np.mean([episode.reward for episode in baseline])
    assert first["rise"] == summary.mean_rise
    assert first["rotation"] == summary.median_rotation
    assert first["success"] == summary.success.share
    assert first["landed"] == summary.landed.share


def test_the_policies_are_those_of_the_evaluations(whole):
    env = make_env(read_options(whole / "options.json").env)
    points = curve(whole)["evaluations"]
    scores = {"best": max(point["score"] for point in points), "last": points[-1]["score"]}
    for name, score in scores.items():
        policy = load_policy(whole / f"{name}.safetensors", env.config)
        episodes = [run_episode(env, seed, policy) for seed in SEEDS]
        assert np.mean([episode.reward for episode in episodes]) == score
        assert policy.card.results["evaluation"]["score"] == score
        assert policy.card.command == ("python", "train.py", "--run", "run", *ARGUMENTS)
        assert {"torch", "stable-baselines3"} <= policy.card.versions.keys()


def test_tensorboard_has_the_numbers(whole):
    events = EventAccumulator(str(whole / "tensorboard")).Reload()
    tags = set(events.Tags()["scalars"])
    assert tags > {
        *("rollout/success", "rollout/landed", "rollout/rise_cm", "rollout/rotation_deg"),
        *("rollout/residual_size", "evaluation/score", "evaluation/success", "train/value_loss"),
    }
    assert any(tag.startswith("rollout/success_") and tag.endswith("_cm") for tag in tags)

    points = curve(whole)["evaluations"]
    scores = [(event.step, event.value) for event in events.Scalars("evaluation/score")]
    assert scores == [(point["timesteps"], pytest.approx(point["score"])) for point in points]
    deviations = [event.value for event in events.Scalars("rollout/noise")]
    steps = [point["timesteps"] for point in points][:-1]
    assert deviations == pytest.approx([np.exp(-1.0 - 0.2 * step / 200) for step in steps])
    # The first update was the value function's.
    sizes = [event.value for event in events.Scalars("rollout/residual_size")]
    assert sizes[:2] == [0.0, 0.0] < sizes[2:]


def test_actions_grow_to_their_scale(monkeypatch):
    """Half of it in the first update, all of it from the second on."""
    scales = []
    call = JumpVecEnv.env_method

    def env_method(self, name, *arguments):
        if name == "scale_actions":
            scales.extend(arguments)
        return call(self, name, *arguments)

    monkeypatch.setattr(JumpVecEnv, "env_method", env_method)
    assert train(monkeypatch, "--run", "run", *ARGUMENTS) == 0
    assert scales == [0.5, 1.0, 1.0]


def test_a_run_that_goes_on_with_other_code_says_so(finished, monkeypatch, capsys):
    (RUN / "checkpoint-000004.safetensors").unlink()
    (RUN / "checkpoint-000004.json").unlink()
    monkeypatch.setattr(training, "source", lambda: "0" * 16)
    assert train(monkeypatch, "--resume", "run") == 0
    assert capsys.readouterr().err.startswith("run was begun with other code: ")


@pytest.mark.fault("killed trainings")
def test_a_killed_run_ends_as_if_it_had_not_been(whole, monkeypatch):
    """Where it hurts most: evaluated and written, but not yet in a checkpoint."""
    program = """
import os, signal, sys

from agents import training
from agents.cli import run

def save_or_die(folder, model, number, progress):
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    save(folder, model, number, progress)

save, training.save_checkpoint = training.save_checkpoint, save_or_die
sys.argv[0] = "train.py"
run(sys.argv[1:])
"""
    result = subprocess.run(
        [sys.executable, "-c", program, "--run", "run", *ARGUMENTS],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == -signal.SIGKILL, result.stderr
    assert load_latest(RUN, pytest.fail).number == 2
    assert len(curve(RUN)["evaluations"]) == 3
    assert train(monkeypatch, "--resume", "run") == 0
    assert results(RUN) == results(whole)


def at_the_end_of_the_third_rollout(monkeypatch, do):
    end = training._Run._on_rollout_end

    def interfere(self):
        end(self)
        if self._updates == 3:
            do(self)

    monkeypatch.setattr(training._Run, "_on_rollout_end", interfere)


def test_an_interrupted_run_says_how_to_go_on_and_does(whole, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        at_the_end_of_the_third_rollout(patch, lambda run: signal.raise_signal(signal.SIGTERM))
        assert train(patch, "--run", "run", *ARGUMENTS) == 130
    err = capsys.readouterr().err
    assert err.endswith("go on with: python train.py --resume run\ninterrupted\n")
    assert load_latest(RUN, pytest.fail).number == 3
    assert not (RUN / "checkpoint-000004.json").exists()
    assert train(monkeypatch, "--resume", "run") == 0
    assert "going on from step 144 of 200\n" in capsys.readouterr().err
    assert results(RUN) == results(whole)


@pytest.mark.fault("damaged files")
def test_a_run_goes_on_from_the_checkpoint_before_a_damaged_one(
    whole, finished, monkeypatch, capsys
):
    newest = RUN / "checkpoint-000004.safetensors"
    newest.write_bytes(newest.read_bytes()[:-1])
    for name in ("last.json", "best.json", "curve.json"):
        (RUN / name).unlink()
    assert train(monkeypatch, "--resume", "run") == 0
    said = capsys.readouterr().err.splitlines()[0]
    assert said.startswith(f"{newest}: damaged")
    assert said.endswith("; checkpoint-000003.safetensors is used instead")
    assert {**results(RUN), "best.json": 0} == {**results(whole), "best.json": 0}
    *gone, last = curve(RUN)["minutes"]
    assert gone == [None] * 3
    assert last > 0
    board = EventAccumulator(str(RUN / "tensorboard")).Reload()
    steps = [event.step for event in board.Scalars("evaluation/score")]
    assert steps == [point["timesteps"] for point in curve(RUN)["evaluations"]]


def test_a_finished_run_stays_as_it_is(whole, finished, monkeypatch, capsys):
    assert train(monkeypatch, "--resume", "run") == 0
    assert capsys.readouterr().err == "run is finished\n"
    assert written(RUN) == written(whole)


def error(err):
    """The one line that says what went wrong, and the last one."""
    (line,) = (line for line in err.splitlines() if "error" in line.lower())
    assert err.endswith(f"{line}\n")
    assert "Traceback" not in err
    return line


@pytest.mark.fault("full disk")
def test_a_full_disk_is_named_and_spares_the_checkpoints_before(whole, monkeypatch, capsys):
    sync = os.fsync

    def full(descriptor):
        if "checkpoint-000003.json" in os.readlink(f"/proc/self/fd/{descriptor}"):
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    before = children()
    assert train(monkeypatch, "--run", "run", *ARGUMENTS) == 2
    assert children() == before
    line = error(capsys.readouterr().err)
    assert line == "error: [Errno 28] No space left on device: 'run'"
    assert load_latest(RUN, pytest.fail).number == 2
    assert not list(RUN.glob("*.part"))


@pytest.mark.fault("killed trainings")
def test_a_dead_worker_ends_the_run_and_leaves_no_process(monkeypatch, capsys):
    def kill(run):
        os.kill(run.model.get_env().remotes[1].process.pid, signal.SIGKILL)

    at_the_end_of_the_third_rollout(monkeypatch, kill)
    before = children()
    assert train(monkeypatch, "--run", "run", *ARGUMENTS) == 2
    assert children() == before
    assert error(capsys.readouterr().err) == "error: worker 1 died (exit code -9)"
    assert load_latest(RUN, pytest.fail).number == 3


def test_no_time_is_promised_that_ignores_evaluations(monkeypatch):
    shown, display = [], training.progress_display

    def remember(console, *columns):
        shown.extend(columns)
        return display(console, *columns)

    monkeypatch.setattr(training, "progress_display", remember)
    arguments = ("--run", "run", *ARGUMENTS, "--timesteps", "1", "--jobs", "1")
    assert train(monkeypatch, *arguments) == 0
    assert shown
    assert not any(isinstance(column, TimeRemainingColumn) for column in shown)


def test_a_robot_that_never_flies_does_not_stop_the_training(monkeypatch):
    """It has no rotation in flight."""
    weak = '{"motor": {"kind": "dc", "current_limit": 0.3}}'
    arguments = ("--run", "run", *ARGUMENTS, "--actuators", weak, "--timesteps", "1")
    assert train(monkeypatch, *arguments, "--jobs", "1") == 0
    point = curve(RUN)["evaluations"][-1]
    assert point["rise"] == 0.0
    assert point["rotation"] is None
    events = EventAccumulator(str(RUN / "tensorboard")).Reload()
    assert [event.value for event in events.Scalars("rollout/rise_cm")] == [0.0]


def test_the_longest_curve_fits_into_a_checkpoint():
    numbers = ("episodes", "score", "success", "landed", "rise", "rotation")
    point = dict.fromkeys(("timesteps", *numbers), -0.12345678901234567)
    point["success_by_command"] = {f"{cm} to {cm + 1} cm": 1 / 3 for cm in range(10, 24)}
    progress = {"progress": {"updates": 10**9, "curve": [point] * (MOST_CHECKPOINTS + 1)}}
    assert len(strict_json(progress, indent=2)) < 0.9 * MAX_CARD_SIZE


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"updates": -1}, "updates=-1 is not allowed: expected a whole number from 0 updates"),
        ({"updates": None}, "updates=None"),
        ({"curve": {}}, "curve={} is not allowed: expected a list of 2 evaluations"),
        ({"curve": [{"score": 1.0}]}, "a list of 2 evaluations"),
        ({"curve": [{"score": 1.0}, {}]}, "score=None"),
        ({"curve": [{"score": 1.0}, 3]}, "point of the curve=3"),
        ({"curve": [{"score": 1.0}, {"score": math.nan}]}, "score=nan"),
    ],
)
def test_a_checkpoint_without_a_trainings_progress_is_refused(change, message):
    progress = {"updates": 4, "curve": [{"score": 1.0}, {"score": 2.0}]}
    assert check_progress(2, progress) == (4, progress["curve"])
    with pytest.raises(CheckpointError, match=f"^checkpoint 2: .*{re.escape(message)}"):
        check_progress(2, progress | change)
