"""Arrays and their card on disk: complete and together, or not at all."""

import errno
import hashlib
import json
import os
import pickle
import stat
import zipfile
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save

from icub_jump_env import files as package_files
from icub_jump_env.carded import MAX_CARD_SIZE
from icub_jump_env.errors import ICubJumpError, PolicyFileError
from icub_jump_env.files import MAX_DEPTH
from icub_jump_env.policy.files import load_tensors, save_tensors

TENSORS = {
    "weights": np.arange(6, dtype=np.float32).reshape(2, 3),
    "moments": np.array([np.pi, -0.0, np.inf]),
    "steps": np.array(12345678901234),
    "random": np.arange(250, dtype=np.uint8),
    "done": np.array([True, False]),
    "none": np.zeros((3, 0)),
}
CARD = {"episode": 7, "names": ["a", "b"], "rate": None, "inner": {"x": 0.1}}


@pytest.fixture
def path(tmp_path):
    """A pair on disk."""
    path = tmp_path / "state.safetensors"
    save_tensors(path, TENSORS, CARD)
    return path


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def refused(path, match):
    with pytest.raises(PolicyFileError, match=match) as error:
        load_tensors(path)
    assert str(error.value).startswith(error.value.path)
    assert path.stem in error.value.path
    return error.value


def test_arrays_of_any_kind_come_back_to_the_bit(path):
    for name in (path, path.with_suffix(".json")):
        tensors, card = load_tensors(name)
        assert tensors.keys() == TENSORS.keys()
        for key, array in TENSORS.items():
            assert tensors[key].dtype == array.dtype
            assert tensors[key].shape == array.shape
            assert tensors[key].tobytes() == array.tobytes()
        assert card == CARD | {"sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert contents(path.parent).keys() == {"state.safetensors", "state.json"}


def test_arrays_that_do_not_lie_row_by_row(path):
    """Safetensors itself would scramble them in silence."""
    table = np.arange(12.0).reshape(3, 4)
    save_tensors(path, {"turned": table.T, "thinned": table[:, ::2]}, {})
    tensors, _ = load_tensors(path)
    assert (tensors["turned"] == table.T).all()
    assert (tensors["thinned"] == table[:, ::2]).all()


def test_a_new_pair_takes_the_place_of_the_old_one(path):
    save_tensors(path.with_suffix(".json"), {"x": np.ones(2)}, {"episode": 8})
    tensors, card = load_tensors(path)
    assert tensors["x"].tolist() == [1.0, 1.0]
    assert card["episode"] == 8


def test_names_with_dots(tmp_path):
    path = tmp_path / "run.v1.safetensors"
    save_tensors(path, TENSORS, CARD)
    assert contents(tmp_path).keys() == {"run.v1.safetensors", "run.v1.json"}


@pytest.mark.parametrize("name", ["state.pt", "state", "state.safetensors.zip", ".json", ""])
def test_other_names_are_refused(tmp_path, name):
    for action in (load_tensors, lambda path: save_tensors(path, TENSORS, CARD)):
        with pytest.raises(PolicyFileError, match=r"neither a \.safetensors file nor"):
            action(tmp_path / name if name else Path())


@pytest.mark.parametrize("missing", [".safetensors", ".json"])
def test_half_a_pair(path, missing):
    path.with_suffix(missing).unlink()
    assert refused(path, "no such file").path.endswith(missing)
    path.with_suffix(missing).mkdir()
    refused(path, "no such file")


def test_truncated_anywhere(path):
    content = path.read_bytes()
    for length in (0, 1, 7, 8, 9, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:length])
        refused(path, "damaged, or not the file that state.json was written for")
    card = path.with_suffix(".json")
    path.write_bytes(content)
    text = card.read_bytes()
    for length in (0, 1, len(text) // 2, len(text) - 2):
        card.write_bytes(text[:length])
        assert refused(path, "not readable as JSON").path == str(card)


def test_any_flipped_bit(path):
    content = path.read_bytes()
    for position in (0, 8, 20, len(content) // 2, len(content) - 1):
        for bit in (0, 7):
            damaged = bytearray(content)
            damaged[position] ^= 1 << bit
            path.write_bytes(damaged)
            refused(path, "damaged")


def test_the_card_of_another(path):
    other = path.with_name("other.safetensors")
    save_tensors(other, {"x": np.ones(2)}, CARD)
    path.with_suffix(".json").write_bytes(other.with_suffix(".json").read_bytes())
    refused(path, "damaged, or not the file")
    load_tensors(other)


@pytest.mark.parametrize("digest", [None, 7, "", "0" * 64, ["x"]])
def test_a_card_with_another_hash_or_none(path, digest):
    card = path.with_suffix(".json")
    card.write_text(json.dumps(CARD | {"sha256": digest}))
    refused(path, "damaged, or not the file")
    card.write_text(json.dumps(CARD))
    refused(path, "damaged, or not the file")


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (b"[1, 2]", "not a JSON object"),
        (b"null", "not a JSON object"),
        (b"{'a': 1}", "not readable as JSON"),
        (b'{"a": "\xff"}', "not readable as JSON"),
        (b'{"a": ' + b"9" * 10_000 + b"}", "not readable as JSON"),
        (b"[" * 100_000 + b"]" * 100_000, "nested more than 32 deep"),
        (b'{"a": ' + b"[" * MAX_DEPTH + b"]" * MAX_DEPTH + b"}", "nested more than"),
        (b'{"a": "' + b"x" * MAX_CARD_SIZE + b'"}', "larger than 1048576 bytes"),
    ],
)
@pytest.mark.fault("hostile policies")
def test_cards_that_are_something_else(path, text, match):
    path.with_suffix(".json").write_bytes(text)
    assert refused(path, match).path.endswith(".json")


def test_the_deepest_card_can_be_read(path):
    deep = []
    for _ in range(MAX_DEPTH - 2):
        deep = [deep]
    save_tensors(path, TENSORS, {"deep": deep})
    assert load_tensors(path)[1]["deep"] == deep


def header(entries, data=b""):
    text = json.dumps(entries).encode()
    return len(text).to_bytes(8, "little") + text + data


def entry(dtype="F32", shape=(1,), size=4):
    return {"a": {"dtype": dtype, "shape": shape, "data_offsets": [0, size]}}


@pytest.mark.parametrize(
    "content",
    [
        b"", b"x" * 7, b"\xff" * 100, (2**63).to_bytes(8, "little"), b"\0" * 8,
        header([1]), header({"a": 1}), header(entry("BF16", size=2), b"12"),
        header(entry("F4", (2,), 1), b"1"), header(entry(shape=(-1,)), b"1234"),
        header(entry(shape=(2**62, 2**62)), b"1234"), header(entry(shape=(2**63, 0), size=0)),
        header(entry(shape=(1,) * 100), b"1234"), header(entry(), b"12"),
        header(entry(), b"12345678"), header(entry(size=2**40)),
        b"(lp0\n.", pickle.dumps({"a": [1.0]}),
    ],
)  # fmt: skip
@pytest.mark.fault("hostile policies")
def test_other_files_with_the_right_hash(path, content):
    path.write_bytes(content)
    digest = hashlib.sha256(content).hexdigest()
    path.with_suffix(".json").write_text(json.dumps({"sha256": digest}))
    assert refused(path, "not a safetensors file").path == str(path)


class Intruder:
    """Unpickled, it leaves a file behind."""

    def __init__(self, trace):
        self.trace = trace

    def __reduce__(self):
        return os.mkdir, (str(self.trace),)


@pytest.mark.parametrize("zipped", [False, True])
@pytest.mark.fault("hostile policies")
def test_a_pickle_is_not_executed(path, zipped):
    trace = path.parent / "trace"
    pickle.loads(pickle.dumps(Intruder(trace)))
    assert trace.exists()
    trace.rmdir()
    if zipped:  # as torch and Stable-Baselines3 write them
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("archive/data.pkl", pickle.dumps(Intruder(trace)))
    else:
        path.write_bytes(pickle.dumps(Intruder(trace)))
    refused(path, "damaged")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    path.with_suffix(".json").write_text(json.dumps({"sha256": digest}))
    refused(path, "not a safetensors file")
    assert not trace.exists()


@pytest.mark.fault("hostile policies")
def test_large_files_are_not_read(path):
    assert load_tensors(path, max_size=path.stat().st_size)
    with pytest.raises(PolicyFileError, match="larger than 100 bytes"):
        load_tensors(path, max_size=100)
    os.truncate(path, 2**40)  # takes no space
    with pytest.raises(PolicyFileError, match="larger than"):
        load_tensors(path, max_size=2**24)


@pytest.mark.parametrize(
    ("tensors", "card", "match"),
    [
        ({"a": np.array(["text"])}, {}, "Unknown dtype"),
        ({"a": np.array([object()])}, {}, "Unknown dtype"),
        ({}, {"a": "x" * MAX_CARD_SIZE}, "larger than"),
        ({}, {"a": [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]}, "nested"),
    ],
)
def test_what_could_not_be_read_back_is_not_written(path, tensors, card, match):
    before = contents(path.parent)
    with pytest.raises(PolicyFileError, match=match):
        save_tensors(path, tensors, card)
    assert contents(path.parent) == before


def test_names_reach_the_disk_one_after_the_other(tmp_path, monkeypatch):
    """A folder is synced after each rename, so that a power cut keeps their order."""
    calls, replace, sync = [], Path.replace, os.fsync

    def watched_replace(self, target):
        calls.append(target.name)
        return replace(self, target)

    def watched_sync(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            calls.append(os.fstat(descriptor).st_ino)
        sync(descriptor)

    monkeypatch.setattr(Path, "replace", watched_replace)
    monkeypatch.setattr(os, "fsync", watched_sync)
    (tmp_path / "b").mkdir()
    package_files.write_files({tmp_path / "first": b"1", tmp_path / "b" / "second": b"2"})
    folders = [tmp_path.stat().st_ino, (tmp_path / "b").stat().st_ino]
    assert calls == ["first", folders[0], "second", folders[1]]


def test_a_folder_that_cannot_be_synced_is_no_error(tmp_path, monkeypatch):
    sync = os.fsync

    def refuse(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "Invalid argument")
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", refuse)
    package_files.write_file(tmp_path / "file", b"1")
    assert (tmp_path / "file").read_bytes() == b"1"


@pytest.mark.parametrize("failing", [0, 1])
@pytest.mark.parametrize("call", ["fsync", "write"])
@pytest.mark.fault("full disk")
def test_a_full_disk_keeps_the_old_pair(path, monkeypatch, failing, call):
    """At the first file or at the second."""
    before, calls = contents(path.parent), []

    def full(*arguments):
        calls.append(arguments)
        if len(calls) > failing:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    if call == "fsync":
        monkeypatch.setattr(package_files.os, "fsync", full)
    else:
        opened = os.fdopen

        def fdopen(*arguments):
            full()
            return opened(*arguments)

        monkeypatch.setattr(package_files.os, "fdopen", fdopen)
    with pytest.raises(OSError, match="No space left") as error:
        save_tensors(path, {"x": np.ones(2)}, {"episode": 8})
    assert not isinstance(error.value, ICubJumpError)
    assert len(calls) == failing + 1
    assert contents(path.parent) == before
    assert load_tensors(path)[1]["episode"] == 7


class Killed(BaseException):
    """The end of the process."""


@pytest.mark.parametrize("earlier", [True, False])
def test_killed_between_the_two_files(tmp_path, monkeypatch, earlier):
    path = tmp_path / "state.safetensors"
    if earlier:
        save_tensors(path, TENSORS, CARD)
    replace = Path.replace

    def replace_one(self, target):
        if target.suffix == ".json":
            raise Killed
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", replace_one)
    with pytest.raises(Killed):
        save_tensors(path, {"x": np.ones(2)}, {"episode": 8})
    assert path.read_bytes() == save({"x": np.ones(2)})
    refused(path, "damaged, or not the file" if earlier else "no such file")
    monkeypatch.undo()
    save_tensors(path, {"x": np.ones(2)}, {"episode": 8})
    assert load_tensors(path)[1]["episode"] == 8


def test_a_folder_that_does_not_exist(tmp_path):
    with pytest.raises(FileNotFoundError):
        save_tensors(tmp_path / "new" / "state.safetensors", TENSORS, CARD)


def test_the_error_survives_its_way_from_a_worker():
    error = PolicyFileError("a.json", "not JSON")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.path, again.problem) == ("a.json: not JSON", "a.json", "not JSON")
