"""Policies by file and by name: damaged ones, and what their names may hold."""

import json
import shutil

import pytest
from contenders import evaluate, refusal, save_constant

from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.contender import read_contenders
from icub_jump_env.policy import load_policy
from icub_jump_env.policy.saving import SHIPPED

SHORT = ("--stand-time", "0.1")


class TestDamagedFiles:
    @pytest.fixture
    def file(self, tmp_path):
        return save_constant(tmp_path / "mine.safetensors", 0.1, 0, 0)

    def test_missing(self, capsys, tmp_path, file):
        assert "none.safetensors: no such file" in refusal(capsys, "--policy", "none.safetensors")
        file.with_suffix(".json").unlink()
        assert "mine.json: no such file" in refusal(capsys, "--policy", file)

    def test_truncated_or_changed(self, capsys, file):
        whole = file.read_bytes()
        for content in (whole[:-1], whole[:-1] + bytes([whole[-1] ^ 1]), b""):
            file.write_bytes(content)
            assert "mine.safetensors: damaged" in refusal(capsys, "--policy", file)

    def test_a_card_of_another_policy(self, capsys, tmp_path, file):
        other = save_constant(tmp_path / "other.safetensors", 0.2, 0, 0)
        shutil.copy(other.with_suffix(".json"), file.with_suffix(".json"))
        assert "not the file that mine.json was written for" in refusal(capsys, "--policy", file)

    def test_a_card_with_a_bad_field(self, capsys, file):
        card = file.with_suffix(".json")
        card.write_text(json.dumps(json.loads(card.read_text()) | {"action_scale": 7}))
        assert "action_scale=7" in refusal(capsys, "--policy", file)

    @pytest.mark.parametrize("name", ["jump.pt", "jump"])
    def test_another_kind_of_file(self, capsys, tmp_path, name):
        (tmp_path / name).touch()
        assert "neither a .safetensors file" in refusal(capsys, "--policy", name)

    def test_one_bad_file_of_a_comparison_is_enough(self, capsys, file):
        message = refusal(capsys, "--compare", "baseline", file, "none.safetensors")
        assert "none.safetensors: no such file" in message


class TestNames:
    def test_files_of_one_name_are_called_by_their_folders_too(self, tmp_path):
        words = ["baseline"]
        for name in ("first/best", "second/best", "third/last"):
            file = tmp_path / f"{name}.safetensors"
            file.parent.mkdir()
            words.append(str(save_constant(file, 0, 0, 0)))
        names = [contender.name for contender in read_contenders(words)]
        assert names == ["baseline", "first-best", "second-best", "last"]

    @pytest.mark.fault("hostile policies")
    def test_nothing_in_a_name_reaches_the_terminal(self, capsys, tmp_path):
        file = save_constant(tmp_path / "red\x1b[31m\n[bold]\x07.safetensors", 0.1, 0, 0)
        code, out, err = evaluate(capsys, "--policy", file, *SHORT)
        assert (code, err) == (0, "")
        assert r"with red\x1b[31m\n[bold]\x07, after" in out
        assert out.replace("\n", "").isprintable()
        file.with_suffix(".json").write_text("[]")
        message = refusal(capsys, "--policy", file)
        assert r"red\x1b[31m [bold]\x07.json: not a JSON object" in message

    @pytest.mark.fault("hostile policies")
    def test_nothing_in_a_card_reaches_the_terminal(self, capsys, tmp_path):
        file = save_constant(tmp_path / "mine.safetensors", 0.1, 0, 0)
        card = json.loads(file.with_suffix(".json").read_text())
        for field, value in (("kind", "\x1b[2J\n"), ("\x1b[2J\n", 3), ("axes", ["\x1b[2J\n"])):
            file.with_suffix(".json").write_text(json.dumps(card | {field: value}))
            message = refusal(capsys, "--policy", file)
            assert message.removesuffix("\n").isprintable()
            assert "x1b[2J" in message

    def test_shipped_policies_and_the_baseline_have_names(self):
        found = read_contenders(["torque", "baseline", "torque-constant"])
        assert [contender.name for contender in found] == ["torque", "baseline", "torque-constant"]
        assert [contender.is_baseline for contender in found] == [False, True, False]
        (by_path,) = read_contenders([str(SHIPPED / "torque.safetensors")])
        assert found[0].identity == by_path.identity

    @pytest.mark.parametrize(
        ("words", "mode", "height"),
        [
            (["--policy", "torque"], "nominal", 0.04),
            (["--compare", "baseline", "torque", "torque-open-loop"], "compare", (0.04, 0.08)),
        ],
    )
    def test_the_command_line_takes_the_names(self, capsys, monkeypatch, words, mode, height):
        asked = []
        monkeypatch.setattr(
            f"icub_jump_env.evaluation.modes.{mode}.run",
            lambda options, contenders, *_: asked.append((options, contenders)),
        )
        assert evaluate(capsys, *words)[0] == 0
        ((options, contenders),) = asked
        assert [contender.name for contender in contenders] == words[1:]
        config = load_policy("torque").card.config
        assert options.config.controller == config.controller
        assert options.config.com_displacement == config.com_displacement
        assert options.config.jump_height == height

    def test_the_same_policy_by_two_paths_is_refused(self, tmp_path):
        file = save_constant(tmp_path / "mine.safetensors", 0, 0, 0)
        with pytest.raises(ConfigError, match="different names"):
            read_contenders([str(file), str(file.with_suffix(".json"))])

    def test_identity_is_that_of_card_and_numbers(self, tmp_path):
        file = save_constant(tmp_path / "mine.safetensors", 0.5, 0, 0)
        before = read_contenders([str(file)])[0].identity
        assert before == read_contenders([str(file)])[0].identity
        card = json.loads(file.with_suffix(".json").read_text())
        file.with_suffix(".json").write_text(json.dumps(card | {"action_scale": 0.1}))
        after = read_contenders([str(file)])[0].identity
        assert after["name"] == before["name"]
        assert after["sha256"] != before["sha256"]
