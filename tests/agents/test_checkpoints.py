"""Checkpoints: bit-exact continuation, and a way back from damaged ones."""

import contextlib
import dataclasses
import errno
import os
import random
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from troubled_env import TroubledEnv

from agents import checkpoints
from agents.checkpoints import (
    CheckpointError,
    begin_segment,
    load_latest,
    restore,
    save_checkpoint,
)
from agents.vec_env import JumpVecEnv
from icub_jump_env.policy.files import load_tensors, save_tensors

SEED = 20190425
STEPS = 64
"""Of a rollout: two environments, 32 steps each."""
TOTAL = 5 * STEPS


@pytest.fixture(scope="module")
def envs():
    env = JumpVecEnv([TroubledEnv, TroubledEnv])
    yield env
    env.close()


def make_model(env, seed, width=8):
    return PPO(
        "MlpPolicy",
        env,
        n_steps=STEPS // 2,
        batch_size=16,
        n_epochs=2,
        learning_rate=lambda remaining: 0.002 + 0.01 * remaining,
        clip_range=lambda remaining: 0.1 + 0.1 * remaining,
        policy_kwargs={"net_arch": [width]},
        seed=seed,
        device="cpu",
    )


class Segments(BaseCallback):
    """A checkpoint after each update, in the run's folder and in one of its own."""

    def __init__(self, folder, number):
        super().__init__()
        self.folder, self.number, self.seeds = folder, number, None

    def _on_rollout_start(self):
        if self.seeds is not None:
            self._save()
        self.seeds = begin_segment(self.model, SEED, self.number)

    def _on_training_end(self):
        self._save()

    def _save(self):
        self.number += 1
        for folder in (self.folder, self.folder / f"only {self.number}"):
            folder.mkdir(exist_ok=True)
            save_checkpoint(folder, self.model, self.number, {"seeds": self.seeds})

    def _on_step(self):
        return True


def train(model, folder, number):
    remaining = TOTAL - model.num_timesteps
    model.learn(remaining, Segments(folder, number), reset_num_timesteps=number == 0)


def resume(source, target):
    """Continue a run in this process, with another model and other environments."""
    with contextlib.closing(JumpVecEnv([TroubledEnv, TroubledEnv])) as env:
        model = make_model(env, seed=99)
        checkpoint = load_latest(source, print)
        restore(model, checkpoint)
        train(model, target, checkpoint.number)


def everything(model):
    optimizer = model.policy.optimizer.state_dict()
    tensors = dict(model.policy.state_dict())
    for index, state in optimizer["state"].items():
        tensors |= {f"{index} {key}": value for key, value in state.items()}
    scalars = optimizer["param_groups"], model.num_timesteps, model._n_updates
    return {name: value.numpy().copy() for name, value in tensors.items()}, scalars


def assert_same(first, second):
    assert first[1] == second[1]
    assert first[0].keys() == second[0].keys()
    for name, value in first[0].items():
        assert value.dtype == second[0][name].dtype
        assert value.shape == second[0][name].shape
        assert value.tobytes() == second[0][name].tobytes(), name


@pytest.fixture(scope="module")
def run(envs, tmp_path_factory):
    """A run that never stopped: its folder with the last two checkpoints, and its end."""
    folder = tmp_path_factory.mktemp("run")
    model = make_model(envs, seed=1)
    train(model, folder, 0)
    return folder, model


@pytest.fixture
def folder(run, tmp_path):
    """A copy of the checkpoints."""
    for path in run[0].glob("checkpoint-*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def written(folder):
    """Content of the files in a folder, by name."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_the_last_two_remain(folder):
    assert sorted(written(folder)) == [
        "checkpoint-000004.json",
        "checkpoint-000004.safetensors",
        "checkpoint-000005.json",
        "checkpoint-000005.safetensors",
    ]


def test_a_checkpoint_is_restored_bit_for_bit(run, envs, folder):
    model = make_model(envs, seed=2)
    checkpoint = load_latest(folder, pytest.fail)
    restore(model, checkpoint)
    assert_same(everything(model), everything(run[1]))
    assert checkpoint.number == 5
    assert checkpoint.num_timesteps == TOTAL
    assert len(checkpoint.progress["seeds"]) == 2


def test_a_run_continued_by_another_process_ends_the_same(run, tmp_path):
    source = run[0] / "only 2"
    folders = Path(__file__).parents[2], Path(__file__).parent
    code = f"""
from pathlib import Path
from test_checkpoints import resume

resume(Path({str(source)!r}), Path({str(tmp_path)!r}))
"""
    subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))},
        check=True,
    )
    expected = written(run[0])
    assert expected["only 4/checkpoint-000004.json"] != expected["only 5/checkpoint-000005.json"]
    before = {name for name in expected if name.startswith(("only 1", "only 2"))}
    assert written(tmp_path) == {name: expected[name] for name in expected.keys() - before}


def test_a_segment_is_a_function_of_seed_and_number(run):
    model = run[1]

    def begin(seed, number):
        seeds = begin_segment(model, seed, number)
        numpy_draw = np.random.random()  # noqa: NPY002 (Stable-Baselines3 draws from it)
        draws = random.random(), numpy_draw, torch.rand(1).item()
        return seeds, draws, model.action_space.sample(), model._last_obs.tolist()

    first = begin(1, 2)
    assert first == begin(1, 2)
    for other in (begin(1, 3), begin(2, 2)):
        assert all(one != another for one, another in zip(first, other, strict=True))
    expected = [TroubledEnv().reset(seed=seed)[0].tolist() for seed in first[0]]
    assert first[3] == expected
    assert model._last_episode_starts.tolist() == [True, True]
    assert not model.ep_info_buffer


def test_no_checkpoint_is_none(tmp_path):
    (tmp_path / "checkpoint-000001.safetensorsx.part").touch()
    assert load_latest(tmp_path, pytest.fail) is None


def truncate(path):
    path.write_bytes(path.read_bytes()[:-20])


def flip_a_bit(path):
    content = bytearray(path.read_bytes())
    content[-100] ^= 4
    path.write_bytes(content)


def change_a_digit(path):
    content = path.read_text()
    changed = content.replace(f'"num_timesteps": {TOTAL}', f'"num_timesteps": {TOTAL + 1}')
    assert changed != content
    path.write_text(changed)


DAMAGES = {
    "truncated": (".safetensors", truncate),
    "a bit flipped": (".safetensors", flip_a_bit),
    "tensors missing": (".safetensors", Path.unlink),
    "card missing": (".json", Path.unlink),
    "card truncated": (".json", truncate),
    "a digit of the card": (".json", change_a_digit),
    "card of the one before": (
        ".json",
        lambda path: path.write_bytes((path.parent / "checkpoint-000004.json").read_bytes()),
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.fault("damaged files")
def test_the_previous_one_is_used_if_the_newest_is_damaged(folder, damage):
    suffix, spoil = DAMAGES[damage]
    spoil(folder / f"checkpoint-000005{suffix}")
    said = []
    assert load_latest(folder, said.append).number == 4
    (line,) = said
    assert "checkpoint-000005" in line
    assert line.endswith("; checkpoint-000004.safetensors is used instead")
    assert "\n" not in line


def rewrite(folder, called=5, tensors=(), **fields):
    """A checkpoint whose files fit together, with some of its content exchanged."""
    path = folder / f"checkpoint-{called:06d}.safetensors"
    arrays, card = load_tensors(folder / "checkpoint-000005.safetensors")
    del card["sha256"]
    card |= fields
    arrays |= dict(tensors) | {checkpoints._FINGERPRINT: checkpoints._fingerprint(card)}
    save_tensors(path, arrays, card)


BIAS = "policy.action_net.bias"
CONTENTS = {
    "of another number": (
        {"number": 4},
        "number=4 is not allowed: expected 5, as the file is called",
    ),
    "no number": ({"number": True}, "number=True"),
    "negative steps": ({"num_timesteps": -1}, "num_timesteps=-1"),
    "steps as text": ({"num_timesteps": "9"}, "num_timesteps='9'"),
    "half an update": ({"n_updates": 0.5}, "n_updates=0.5"),
    "no progress": ({"progress": [1]}, r"progress=\[1\]"),
    "no groups": ({"param_groups": 3}, "param_groups=3"),
    "groups of nothing": ({"param_groups": [3]}, r"param_groups=\[3\]"),
    "another version": ({"wings": 2}, "of another version"),
    "NaN": (
        {"tensors": {BIAS: np.array([np.nan], np.float32)}},
        rf"{BIAS}=nan .*: expected finite numbers",
    ),
    "infinity": ({"tensors": {"optimizer.0.step": np.float32(np.inf)}}, "optimizer.0.step=inf"),
    "doubles": (
        {"tensors": {BIAS: np.zeros(1)}},
        f"{BIAS}='float64' is not allowed: expected float32",
    ),
    "other tensors": ({"tensors": {"wings": np.zeros(1, np.float32)}}, "tensors='wings'"),
}


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.fault("damaged files")
def test_the_previous_one_is_used_if_the_newest_is_none(folder, content):
    changes, message = CONTENTS[content]
    rewrite(folder, **changes)
    said = []
    assert load_latest(folder, said.append).number == 4
    (line,) = said
    assert re.search(rf"checkpoint-000005\.json: .*{message}", line)


def test_one_called_by_another_number_is_passed_over(folder):
    rewrite(folder, 6)
    said = []
    assert load_latest(folder, said.append).number == 5
    assert "number=5 is not allowed: expected 6, as the file is called" in said[0]


@pytest.mark.fault("damaged files")
def test_one_that_is_too_large_is_passed_over(folder, monkeypatch):
    size = (folder / "checkpoint-000005.safetensors").stat().st_size
    rewrite(folder, tensors={"policy.large": np.zeros(99, np.float32)})
    monkeypatch.setattr(checkpoints, "MAX_CHECKPOINT_SIZE", size)
    said = []
    assert load_latest(folder, said.append).number == 4
    assert f"larger than {size} bytes" in said[0]


@pytest.mark.fault("damaged files")
def test_all_damaged_is_an_error_that_names_them(folder):
    for path in folder.glob("*.safetensors"):
        truncate(path)
    with pytest.raises(CheckpointError, match=r"^.*000005.*000004.*$"):
        load_latest(folder, pytest.fail)


@pytest.mark.fault("full disk")
def test_a_full_disk_keeps_the_previous_ones(run, folder, monkeypatch):
    before = written(folder)
    sync = os.fsync
    for allowed in (0, 1):
        left = iter(range(allowed))

        def full(descriptor, left=left):
            if next(left, None) is None:
                raise OSError(errno.ENOSPC, "No space left on device")
            sync(descriptor)

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left"):
            save_checkpoint(folder, run[1], 6, {})
        assert written(folder) == before


def test_progress_that_json_lacks_is_refused(run, folder):
    before = written(folder)
    with pytest.raises(TypeError):
        save_checkpoint(folder, run[1], 6, {"when": object()})
    assert written(folder) == before


def test_another_architecture_is_refused(envs, folder):
    with pytest.raises(CheckpointError, match=r"^checkpoint 5 does not fit the model: .*$"):
        restore(make_model(envs, seed=3, width=9), load_latest(folder, pytest.fail))


@pytest.mark.parametrize(
    "change",
    [
        {"tensors": {"nonsense": np.zeros(1)}},
        {"tensors": {"optimizer.first.step": np.zeros(1)}},
        {"tensors": {"optimizer": np.zeros(1)}},
        {"tensors": {"optimizer.99.step": np.zeros(())}},
        {"tensors": {"optimizer.0.step": np.zeros(1)}},
        {"tensors": {"optimizer.0.exp_avg": np.zeros((1, 1))}},
        {"param_groups": [{}]},
        {"param_groups": []},
        {"param_groups": None},
        {"lr": float("nan")},
        {"lr": None},
        {"lr": "fast"},
        {"betas": [0.9, float("inf")]},
    ],
)
@pytest.mark.fault("damaged files")
def test_one_made_by_hand_that_lacks_something_is_refused(envs, folder, change):
    checkpoint = load_latest(folder, pytest.fail)
    (group,) = checkpoint.param_groups
    if "tensors" in change:
        change = {"tensors": checkpoint.tensors | change["tensors"]}
    elif "param_groups" not in change:
        change = {"param_groups": [group | change]}
    checkpoint = dataclasses.replace(checkpoint, **change)
    with pytest.raises(CheckpointError, match=r"^checkpoint 5 does not fit the model: .*$"):
        restore(make_model(envs, seed=3), checkpoint)
