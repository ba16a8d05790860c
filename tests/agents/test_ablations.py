"""The table of trainings, and the picture of their curves."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import trim_mean

from agents import ablations, shipped
from agents.ablations import AblationOptions, compare_trainings
from agents.learning_figure import learning_curves
from agents.options import TASK
from agents.rivals import constant_shift
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.rollout import make_env, run_episode
from icub_jump_env.policy import save_policy

CONFIG = dataclasses.replace(TASK, stand_time=0.1)
SEEDS = range(3000, 3002)
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
    monkeypatch.setattr(shipped, "TASK", CONFIG)
    monkeypatch.setattr(ablations, "TEST", SEEDS)
    monkeypatch.setattr(ablations, "RUNS", Path("kept"))
    Path("kept").mkdir()
    for number, (name, policy) in enumerate(SHIFTS.items()):
        save_policy(
            f"kept/{name}.safetensors", policy, config=CONFIG, versions={},
            command=("python", "x"), seed=None, results={},
        )  # fmt: skip
        Path(f"kept/{name}.curve.json").write_text(json.dumps(curve(0.01 * number)))
    return Path("kept")


def test_each_kind_has_a_row_with_what_its_policies_do(runs, capsys):
    compare_trainings(AblationOptions(episodes=2))
    out = capsys.readouterr().out
    env = make_env(CONFIG)
    rises = {
        name: 100 * np.mean([run_episode(env, s, policy).jump["flight_height"] for s in SEEDS])
        for name, policy in SHIFTS.items()
    }
    still = rises.pop("velocity-still-seed0")
    rows = {
        line.split("  ")[0].strip(): line.split()
        for line in out.splitlines()
        if "velocity" in line
    }
    assert rows["velocity, baseline"][2] == "-"
    assert rows["velocity, baseline"][-3:] == [f"{still:.2f}", "-", "-"]
    assert rows["velocity-still"][-3:] == [f"{still:.2f}", "-", "7"]
    seeds, *_, rise, low, to, high, minutes = rows["velocity"][1:]
    assert (seeds, to, minutes) == ("5", "to", "7")
    assert float(rise) == pytest.approx(trim_mean(list(rises.values()), 0.25), abs=0.006)
    assert min(rises.values()) - 0.006 <= float(low) < float(high) <= max(rises.values()) + 0.006
    assert re.search("seeds 3000 to 3001; interquartile mean over the training", out)


def test_without_runs_it_says_how_to_make_them(monkeypatch):
    monkeypatch.setattr(ablations, "RUNS", Path("nothing"))
    with pytest.raises(ConfigError, match=r"agents\.evidence"):
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
    assert mean.get_label() == "velocity, 5 seeds"
    assert rise.lines[4].get_ydata().tolist() == pytest.approx([4.4, 4.4])
