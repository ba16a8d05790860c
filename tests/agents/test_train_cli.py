"""The command line of train.py: what reaches the training, and how it refuses."""

import dataclasses
import hashlib
import io
import json
import os
import pickle
import re
import subprocess
import sys
import zipfile
from base64 import b64encode
from pathlib import Path

import pytest
import torch
from stable_baselines3.common.save_util import json_to_data
from tiny_run import UNUSUAL, train, written

from agents.options import TASK, PPOOptions, TrainOptions
from agents.run_folder import lock_run
from icub_jump_env.evaluation.cli import evaluate
from icub_jump_env.evaluation.report.output import write_json
from icub_jump_env.planning.residual import ResidualConfig

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture
def asked(monkeypatch):
    """Parses a command line: the options that would be trained with."""

    def parse(*arguments):
        caught = []
        monkeypatch.setattr(
            "agents.training.train", lambda options, console: caught.append(options)
        )
        assert train(monkeypatch, *arguments) == 0
        return caught[0]

    return parse


@pytest.fixture
def refused(monkeypatch, capsys):
    """Runs train.py: the one line with which it refuses."""

    def refuse(*arguments):
        assert train(monkeypatch, *arguments) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert re.fullmatch(r"error: .*\n", err), err
        return err[7:-1]

    return refuse


@pytest.fixture
def run():
    """A folder ``run`` with a run that has yet to begin."""
    folder = Path("run")
    folder.mkdir()
    options = TrainOptions(ppo=PPOOptions(episodes=6), jobs=3, seed=5)
    write_json(folder / "options.json", {"command": ["python", "train.py"], **options.as_dict()})
    return options


def test_help_lists_the_options_and_needs_no_torch():
    code = (
        "import sys; from agents.cli import run\n"
        "try: run(['--help'])\n"
        "finally: print(*({'torch', 'stable_baselines3'} & {*sys.modules}), file=sys.stderr)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0
    assert result.stderr == "\n"
    for flag in ("--stand-time", "--ppo.log-std", "--timesteps", "--resume", "--checkpoint-every"):
        assert flag in result.stdout


def test_flags_reach_the_options(asked):
    assert asked() == TrainOptions()
    assert asked("--controller", "torque", "--inputs", "command", "--axes", "forward", "lateral",
                 "--ppo.log-std", "-0.5", "-3", "--ppo.hidden", "32", "--seed", "7",
                 "--stand-time", "0.5", "--residual.bandwidth", "20",
                 "--run", "here") == TrainOptions(
        env=TASK.replace(
            controller="torque", stand_time=0.5, residual=ResidualConfig(bandwidth=20.0)
        ),
        inputs="command",
        axes=("forward", "lateral"),
        ppo=PPOOptions(log_std=(-0.5, -3.0), hidden=(32,)),
        seed=7,
        run=Path("here"),
    )  # fmt: skip


def test_a_file_holds_where_the_command_line_says_nothing(asked, run):
    file = Path("run/options.json")
    config = dataclasses.replace(run, config=file)
    assert asked("--config", str(file)) == config
    assert asked(f"--config={file}", "--seed", "6") == dataclasses.replace(config, seed=6)
    # What fits together depends on the file: by default there are 64 episodes and 8 jobs.
    assert asked("--config", str(file), "--jobs", "2").jobs == 2
    assert asked("--config", str(file), "--ppo.episodes", "9").ppo.episodes == 9
    assert asked("--resume", "run") == dataclasses.replace(run, resume=Path("run"))


def test_a_runs_options_are_those_of_another(asked):
    file = Path("options.json")
    write_json(file, UNUSUAL.as_dict())
    options = asked("--config", str(file), "--run", "again")
    assert options == dataclasses.replace(UNUSUAL, config=file, run=Path("again"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--wings", "2"], ["--wings"]),
        (["--timesteps", "many"], ["--timesteps", "'many'"]),
        (["--timesteps", "0"], ["timesteps", "0", "from 1 to 1000000000"]),
        (["--ppo.gamma", "2"], ["gamma", "2", "from 0 to 1"]),
        (["--ppo.hidden", "0"], ["hidden", "0", "from 1 to 512"]),
        (["--jump-height", "7"], ["jump_height", "7", "0.01 to 0.15"]),
        (["--axes", "up"], ["axes", "forward", "lateral", "vertical"]),
        (["--jobs", "7"], ["jobs=7", "divisor of ppo.episodes=64"]),
        (["--render-mode", "human"], ["render_mode", "human"]),
        (["--resume"], ["--resume"]),
        (["--resume", "nowhere"], ["resume", "nowhere", "the folder of a run"]),
        (["--resume", "run", "--run", "other"], ["run", "other", "--resume"]),
        (["--resume", "run", "--config", "x"], ["config", "x", "not with --resume"]),
        (["--resume", "run", "--seed", "6"], ["seed=6", "5, as run/options.json has it"]),
        (["--resume", "run", "--ppo.epochs", "3"], ["ppo.epochs=3", "10, as run/options.json"]),
        (["--resume", "run", "--stand-time", "1"], ["success.stand_time=1.0", "2.0, as run/options"]),
        (["--resume", "run", "--residual.bandwidth", "20"], ["residual.bandwidth=20.0", "15.0"]),
        (["--resume", "run", "--solver", "osqp"], ["controller={", "'osqp'", "'velocity', as run"]),
        (["--run", "run"], ["run='run'", "a folder without a run, or --resume run"]),
        (["--run", "run/options.json"], ["run/options.json", "exists"]),
        (["--config", "nowhere"], ["config", "nowhere", "No such file"]),
        (["--run", "x", "--timesteps", "10000000", "--checkpoint-every", "4"],
         ["checkpoint_every", "4", "at least 9", "500 checkpoints"]),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_line(refused, run, arguments, words):
    before = written(Path("run"))
    line = refused(*arguments)
    for word in words:
        assert word in line
    assert {**written(Path("run")), ".lock": b""} == {**before, ".lock": b""}


def test_a_second_run_in_a_folder_is_refused(refused, run):
    with lock_run(Path("run")):
        for how in ("--resume", "--run"):
            message = f"run is in use by another run, process {os.getpid()}"
            assert refused(how, "run") == message


def test_a_folder_with_checkpoints_alone_is_refused(refused):
    Path("checkpoint-000003.safetensors").touch()
    assert "a folder without a run" in refused("--run", ".")


def test_a_damaged_record_of_the_options_is_refused(refused, run):
    Path("run/options.json").write_text('{"seed": 5')
    assert "config='run/options.json' is not allowed: expected a JSON file" in refused(
        "--resume", "run"
    )


def test_a_missing_package_is_named_with_its_remedy(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "agents.training", None)
    assert 'pip install -c constraints.txt -e ".[rl]"' in refused()


class Bomb:
    def __reduce__(self):
        return os.mkdir, ("exploded",)


def zipped_bomb():
    """A model as Stable-Baselines3 saves it."""
    serialized = b64encode(pickle.dumps(Bomb())).decode()
    weights = io.BytesIO()
    torch.save(Bomb(), weights)
    data = {"policy_class": {":type:": "<class 'abc.ABCMeta'>", ":serialized:": serialized}}
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        file.writestr("data", json.dumps(data))
        file.writestr("policy.pth", weights.getvalue())
        file.writestr("_stable_baselines3_version", "2.9.0")
    return content.getvalue()


BOMBS = {"zip": zipped_bomb(), "pickle": pickle.dumps(Bomb())}


@pytest.mark.parametrize("name", ["data", "policy.pth"])
def test_the_bombs_explode(name):
    with zipfile.ZipFile(io.BytesIO(BOMBS["zip"])) as file:
        content = file.read(name)
    if name == "data":
        json_to_data(content.decode())
    else:
        torch.load(io.BytesIO(content), weights_only=False)
    assert Path("exploded").exists()


@pytest.mark.parametrize("kind", BOMBS)
def test_no_file_is_unpickled(kind, refused, run, capsys):
    """As a file of options, a checkpoint or a policy; with a card whose hash is right."""
    Path("bomb.zip").write_bytes(BOMBS[kind])
    assert "a JSON file" in refused("--config", "bomb.zip")

    names = ("run/checkpoint-000001", "policy")
    for name in names:
        Path(f"{name}.safetensors").write_bytes(BOMBS[kind])
        digest = hashlib.sha256(BOMBS[kind]).hexdigest()
        Path(f"{name}.json").write_text(json.dumps({"sha256": digest}))
    line = refused("--resume", "run")
    assert line.startswith("no checkpoint in run is intact: ")
    assert "not a safetensors file" in line

    for word, problem in (("bomb.zip", "neither"), ("policy.json", "not a safetensors file")):
        with pytest.raises(SystemExit) as end:
            evaluate(["--policy", word])
        assert end.value.code == 2
        assert re.fullmatch(rf"error: .*{problem}.*\n", capsys.readouterr().err)
    assert not Path("exploded").exists()
