"""The table of trainings, and the picture of their curves."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import trim_mean

from agents.options import TASK
from experiments import ablations
from experiments.ablations import (
    AblationOptions,
    compare_trainings,
    runs_interval,
)
from experiments.figures import learning_curves
from experiments.rivals import constant_shift
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.policy import save_policy

CONFIG = TASK.replace(stand_time=0.1)
SEEDS = range(3000, 3002)
METRICS = ("flight_height", "sole_height")
SHIFTS = {f"velocity-seed{seed}": constant_shift(0.1 * seed, 0.1 * seed) for seed in range(5)} | {
    "velocity-still-seed0": constant_shift(0.0, 0.0)
}


def curve(shift, points=3):
    evaluations = [
        {"timesteps": 1000 * i, "success": 0.5 + 0.1 * i + shift, "rise": 0.04 + shift / 10}
        for i in range(points)
    ]
    return {"evaluations": evaluations, "minutes": [1.0, 2.0 + shift, 4.0][:points]}


@pytest.fixture
def runs(monkeypatch):
    monkeypatch.setattr(ablations, "TEST", SEEDS)
    monkeypatch.setattr(ablations, "RUNS", Path("kept"))
    monkeypatch.setattr(ablations, "_RESAMPLES", 200)
    Path("kept").mkdir()
    for number, (name, policy) in enumerate(SHIFTS.items()):
        save_policy(
            f"kept/{name}.safetensors", policy, config=CONFIG, versions={},
            command=("python", "x"), seed=None, results={},
        )  # fmt: skip
        Path(f"kept/{name}.curve.json").write_text(json.dumps(curve(0.01 * number)))
    return Path("kept")


def test_each_kind_has_a_row_with_what_its_policies_do(runs, capsys):
    compare_trainings(AblationOptions(task="v0", episodes=2))
    out = capsys.readouterr().out
    env = make_env(CONFIG)
    jumps = {
        name: [run_episode(env, seed, policy).jump for seed in SEEDS]
        for name, policy in SHIFTS.items()
    }
    heights = {
        name: [100 * np.mean([jump[metric] for jump in done]) for metric in METRICS]
        for name, done in jumps.items()
    }
    rises, soles = zip(*list(heights.values())[:5], strict=True)
    rows = {
        line.split("  ")[0].strip(): re.split("  +", line.strip())[1:]
        for line in out.splitlines()
        if "velocity" in line
    }
    assert list(rows) == ["velocity, baseline", "velocity", "velocity-still (single seed)"]
    seeds, _, nothing, *_, minutes = rows["velocity, baseline"]
    assert (seeds, nothing, minutes) == ("-", "-", "-")
    seeds, _, won, rise, _, sole, higher, minutes = rows["velocity-still (single seed)"]
    assert (seeds, won, higher, minutes) == (
        "1", "+0.0 (+0.0 to +0.0)", "+0.00 (+0.00 to +0.00)", "7",
    )  # fmt: skip
    assert [rise, sole] == [f"{value:.2f}" for value in heights["velocity-still-seed0"]]
    seeds, _, _, rise, gain, sole, _, minutes = rows["velocity"]
    assert (seeds, minutes) == ("5", "7")
    assert float(rise) == pytest.approx(trim_mean(rises, 0.25), abs=0.006)
    assert float(sole) == pytest.approx(trim_mean(soles, 0.25), abs=0.006)
    gain, low, high = map(float, re.findall(r"[+-][\d.]+", gain))
    assert gain == pytest.approx(trim_mean(rises, 0.25) - rises[0], abs=0.006)
    assert low < gain < high
    assert "seeds 3000 to 3001; interquartile means over the training seeds" in out


def test_each_task_has_a_table_of_its_own(runs, capsys):
    compare_trainings(AblationOptions(episodes=2))
    assert "velocity" not in capsys.readouterr().out


class TestRunsInterval:
    def test_where_only_the_training_seeds_differ(self):
        """The middle of 5 equal to their number 0 to 4: the same interval for any episodes."""
        one, many = (np.repeat(np.arange(5.0)[:, None], n, axis=1) for n in (1, 50))
        low, high = runs_interval(many)
        assert (low, high) == runs_interval(one)
        assert 0.0 < low < 1.0
        assert 3.0 < high < 4.0

    def test_where_only_the_episodes_differ_it_is_that_of_their_mean(self, rng):
        gains = rng.normal(2.0, 1.0, 400)
        half = 1.96 * gains.std() / 20
        for seeds in (1, 5):
            found = runs_interval(np.tile(gains, (seeds, 1)))
            assert found == pytest.approx(
                (gains.mean() - half, gains.mean() + half), abs=0.1 * half
            )


def test_without_runs_it_says_how_to_make_them(monkeypatch):
    monkeypatch.setattr(ablations, "RUNS", Path("nothing"))
    with pytest.raises(ConfigError, match=r"experiments\.evidence"):
        compare_trainings(AblationOptions())


def test_curves_show_every_seed_and_their_mean_as_far_as_all_go(runs):
    (runs / "velocity-seed1.curve.json").write_text(json.dumps(curve(0.01, points=2)))
    success, rise = learning_curves(runs).axes
    *seeds, mean = success.lines
    assert len(seeds) == 5  # the ablation is not among them
    assert all(list(line.get_xdata()) == [0, 1] for line in success.lines)
    values = np.array([line.get_ydata() for line in seeds])
    assert values[2].tolist() == pytest.approx([52, 62])
    np.testing.assert_allclose(mean.get_ydata(), values.mean(axis=0))  # they are symmetric
    told = [text.get_text() for text in success.figure.legends[0].get_texts()]
    assert told == ["velocity, each of 5 seeds", "velocity, interquartile mean"]
    assert rise.lines[4].get_ydata().tolist() == pytest.approx([4.4, 4.4])


def test_curves_of_a_task_are_its_own(runs):
    (runs / "disturbed-velocity-seed7.curve.json").write_text(json.dumps(curve(0.0, points=4)))
    success, _ = learning_curves(runs, "disturbed-").axes
    assert [len(line.get_xdata()) for line in success.lines] == [4, 4]  # the seed and the mean
