"""The command ``icub-jump export``."""

import numpy as np
import pytest

from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.export.cli import export
from icub_jump_env.export.tables import read_table
from icub_jump_env.policy import load_policy


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["video"], "export='video' is not allowed: expected one of policy, plan, jump, dataset"),
        (["policy", "velocity"], "missing: PATH"),
        (["policy", "velocity", "x.onnx", "--fast"], "Unrecognized options: --fast"),
        (
            ["policy", "velocity", "x.json"],
            "file='x.json' is not allowed: expected a file whose name ends",
        ),
        (["jump", "--seed", "3"], "missing: PATH"),
        (["jump", "x.csv", "--compare", "a", "b"], "Unrecognized options: --compare"),
        (["dataset", "bad name", "--episodes", "2"], "dataset='bad name' is not allowed"),
        (["jump", "x.csv", "--jump-height", "9"], "jump_height=9.0 is not allowed"),
        (["policy", "nobody", "x.onnx"], "nobody"),
        (["plan", "nowhere/x.csv"], "nowhere/x.csv"),
        (["jump", "nowhere/x.csv"], "nowhere/x.csv"),
    ],
)
def test_bad_words_end_with_one_line_and_write_nothing(tmp_path, capsys, words, complaint):
    with pytest.raises(SystemExit) as end:
        export(words)
    out, err = capsys.readouterr()
    assert (end.value.code, out) == (2, "")
    assert complaint in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_help_names_all(capsys):
    export([])
    assert [line.split()[2] for line in capsys.readouterr().out.splitlines()] == [
        "policy", "plan", "jump", "dataset", "jump",
    ]  # fmt: skip


def test_a_jump_of_a_policy_is_that_of_its_episode(tmp_path, capsys):
    """Its actions are held, so the agent's rate and not the control rate decides."""
    words = ["--policy", "velocity", "--jump-height", "0.06", "--seed", "3"]
    export(["jump", "jump.csv", *words, "--stand-time", "0.1"])
    assert capsys.readouterr().err.endswith("wrote jump.csv\n")
    policy = load_policy("velocity")
    env = make_env(
        policy.card.config.replace(jump_height=0.06, stand_time=0.1, randomization="none")
    )
    heights = [s.com[2] for s in run_episode(env, 3, policy, trace=True).trace]
    columns = read_table(tmp_path / "jump.csv")
    np.testing.assert_array_equal(columns["com.z"][::2][: len(heights) - 1], heights[:-1])
