"""The benchmark: its episodes are those of the environment, and the command says so."""

import json

import numpy as np
import pytest

from icub_jump_env.benchmark import cli
from icub_jump_env.benchmark.cases import CASES, EPISODES, FIRST_SEED, SUCCESS, succeeds
from icub_jump_env.benchmark.cli import bench, standing_height
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode


@pytest.fixture
def few(monkeypatch):
    kept = {name: CASES[name] for name in ("nominal", "five")}
    for module in ("cases", "cli", "results"):
        monkeypatch.setattr(f"icub_jump_env.benchmark.{module}.CASES", kept)
    monkeypatch.setattr(cli, "EPISODES", 2)


def test_the_result_is_what_the_episodes_say(few, tmp_path, capsys):
    bench(["r.json", "--controller", "torque"])
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
    assert written["source"]["policy"]
    bench(["--table", "r.json"])
    assert "torque, baseline" in capsys.readouterr().out


def test_seeds_of_the_cases_do_not_overlap():
    assert EPISODES * len(CASES) == 1000
    assert FIRST_SEED == 20_000  # beyond all of experiments/seeds.py


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
        (["--controller", "torque"], "bench='--controller' is not allowed: a file before"),
        (["--table"], "files"),
        (["--table", "nothing.json"], "nothing.json"),
    ],
)
def test_bad_words_end_with_one_line(words, complaint, capsys):
    with pytest.raises(SystemExit) as end:
        bench(words)
    out, err = capsys.readouterr()
    assert (end.value.code, out, err.count("\n")) == (2, "", 1)
    assert complaint in err
