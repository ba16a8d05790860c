"""The benchmark: its episodes are those of the environment, and the command says so."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from experiments import seeds
from icub_jump_env.benchmark.cases import CASES, EPISODES, FIRST_SEED, SUCCESS, succeeds
from icub_jump_env.benchmark.cli import bench
from icub_jump_env.benchmark.results import Result
from icub_jump_env.benchmark.run import jump, standing_height
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.policy import load_policy

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def few(monkeypatch):
    kept = {name: CASES[name] for name in ("nominal", "five")}
    for module in ("run", "cli", "results"):
        monkeypatch.setattr(f"icub_jump_env.benchmark.{module}.CASES", kept)
    for module in ("run", "results"):
        monkeypatch.setattr(f"icub_jump_env.benchmark.{module}.EPISODES", 2)


def test_the_result_is_what_the_episodes_say(few, tmp_path, capsys):
    bench(["r.json", "--controller", "torque", "--jobs", "2"])
    out = capsys.readouterr().out
    assert "five jumps of 4 cm in a row" in out
    written = json.loads((tmp_path / "r.json").read_text())
    config = JumpConfig.of(controller="torque", **CASES["nominal"].jump, success=SUCCESS)
    env = make_env(config)
    episodes = [run_episode(env, FIRST_SEED + seed) for seed in range(2)]
    score = written["scores"]["nominal"]
    assert score["success"] == {"count": sum(map(succeeds, episodes)), "total": 2}
    assert score["rise"] == np.mean([e.jump["flight_height"] for e in episodes])
    assert written["source"]["config"]["controller"] == "torque"
    assert "randomization" not in written["source"]["config"]  # the benchmark's
    assert written["source"]["seed"] == [FIRST_SEED, FIRST_SEED + 3]
    assert written["source"]["policy"] == {"name": "baseline", "sha256": None}
    bench(["--table", "r.json"])
    table = capsys.readouterr().out
    assert table.count("ICubJump-v0, torque, baseline") == 2
    above = score["above_standing"]
    assert f"{100 * score['rise']:.2f} / {100 * above:.2f}" in table
    assert above < 0.0


class Lean:
    """A policy of somebody's own."""

    def __init__(self, forward):
        self.forward = forward

    def __call__(self, observation):
        return np.array([self.forward, 0.0, 0.0], np.float32)


def test_a_policy_in_python_is_an_entry_and_another_one_jumps_anew(few):
    found = [
        jump(JumpConfig(), "mine", Contender("lean", Lean(forward), version=f"{forward}"))
        for forward in (0.0, 0.2, 0.2)
    ]
    still, moved, again = (result.scores["nominal"].rise for result in found)
    assert still == jump(JumpConfig(), "plain").scores["nominal"].rise
    assert still != moved == again
    first, second, third = (result.source["policy"]["sha256"] for result in found)
    assert first != second == third


def test_a_policy_is_an_entry(few, tmp_path, capsys):
    bench(["r.json", "--policy", "velocity", "--name", "ours [/x]"])
    result = Result.read(tmp_path / "r.json")
    assert result.source["policy"]["name"] == "velocity"
    config = load_policy("velocity").card.config.replace(**CASES["nominal"].jump, success=SUCCESS)
    env = make_env(config)
    rises = [
        run_episode(env, FIRST_SEED + seed, load_policy("velocity")).jump["flight_height"]
        for seed in range(2)
    ]
    assert result.scores["nominal"].rise == np.mean(rises)
    bench(["--table", "r.json"])  # its name is shown as it is
    assert "ours [/x]" in capsys.readouterr().out
    bench(["d.json", "--policy", "disturbed-torque"])
    assert Result.read(tmp_path / "d.json").entry == "ICubJump-v1, torque, disturbed-torque"


def test_the_code_of_the_page_runs(few, tmp_path, monkeypatch):
    (code,) = re.findall(r"```python\n(.*?)```", (DOCS / "benchmark.md").read_text(), re.DOTALL)
    module = code.replace('__name__ == "__main__"', "True").replace("jobs=2", "jobs=1")
    (tmp_path / "mine.py").write_text(module)
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.import_module("mine")
    assert Result.read(tmp_path / "mine.json").entry == "mine"


def test_the_leaderboard_has_all_that_was_entered():
    page = (DOCS / "benchmark.md").read_text()
    files = sorted((DOCS / "leaderboard").iterdir())
    assert files
    for file in files:
        assert f"docs/leaderboard/{file.name}" in page
        assert f"| {Result.read(file).entry} | `icub-jump bench" in page


def test_no_experiment_uses_the_seeds_of_the_benchmark():
    used = [value for value in vars(seeds).values() if isinstance(value, range)]
    assert len(used) > 5
    assert max(each.stop for each in used) <= FIRST_SEED
    assert EPISODES * len(CASES) == 1000


def test_the_robot_stands_higher_than_it_crouches():
    config = JumpConfig()
    env = make_env(config)
    env.reset(seed=0)
    assert env.snapshot().com[2] + 0.1 < standing_height(config) < 0.6


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["r.json", "--jump-height", "0.05"], "jump_height=0.05 is not allowed: left to"),
        (["r.json", "--randomization", "hard"], "randomization='hard' is not allowed: left to"),
        (["r.json", "--robot", "iCubGenova02"], "robot='iCubGenova02' is not allowed: left to"),
        (["r.json", "--com-scaling", "acceleration"], "at most 0.054 m"),
        (["--controller", "torque"], "missing: PATH"),
        (["r.json", "--seed", "3"], "Unrecognized options: --seed"),
        (["--table"], "files of results"),
        (["--table", "nothing.json"], "nothing.json"),
    ],
)
def test_bad_words_end_with_one_line(words, complaint, capsys):
    with pytest.raises(SystemExit) as end:
        bench(words)
    out, err = capsys.readouterr()
    assert (end.value.code, out, err.count("\n")) == (2, "", 1)
    assert complaint in err
