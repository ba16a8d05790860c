"""The arms beside the policies: what they are, how they are judged, what the table says."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from agents.options import TASK
from experiments import ablations, arms, reacting, rivals
from experiments.arms import Arm, ArmsOptions, compare, felt_by_none, render, strongest
from experiments.rivals import constant_shift
from icub_jump_env.errors import ConfigError, PolicyFileError
from icub_jump_env.evaluation.episodes.contender import BASELINE
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.planning.lean import lean_correction
from icub_jump_env.policy import ReplayPolicy, save_policy

AXES = ("forward", "vertical", "pitch")
CONFIG = TASK.replace(stand_time=0.1, lean_correction=True, residual_axes=AXES)
CONSOLE = Console(quiet=True)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(arms, "RUNS", Path("kept"))
    monkeypatch.setattr(arms, "TUNED_ON", range(2))
    monkeypatch.setattr(arms, "FELT_TEST", range(3000, 3002))
    monkeypatch.setattr(reacting, "REACTING_TEST", range(3000, 3002))
    monkeypatch.setattr(reacting, "TUNING", range(4))
    monkeypatch.setattr(arms, "HIGHER", (0.0, 0.01))
    monkeypatch.setattr(rivals, "WITH_MOMENTUM", ((0.0,), (0.0,), (0.0, 0.5)))
    monkeypatch.setattr(rivals, "_COMMANDS", 2)
    monkeypatch.setattr(ablations, "_RESAMPLES", 100)
    Path("kept").mkdir()
    named = {f"disturbed-velocity-seed{seed}": (0.1 * seed, CONFIG) for seed in range(2)}
    named["disturbed-velocity-plan-seed0"] = (0.3, CONFIG.replace(lean_correction=False))
    for name, (shift, config) in named.items():
        save_policy(
            f"kept/{name}.safetensors", constant_shift(shift, 0.0, 0.0), config=config,
            versions={}, command=("python", "x"), seed=None,
            results={"evaluation": {"score": shift}},
        )  # fmt: skip


def rows(out):
    lines = [re.split("  +", line.strip()) for line in out.splitlines()]
    return [line for line in lines if len(line) == 8 and line[0] != "arm"]


def test_every_arm_jumps_the_held_out_episodes_of_its_own_configuration(small, capsys):
    compare(ArmsOptions(episodes=2))
    found = rows(capsys.readouterr().out)
    names = [row[0] for row in found]
    assert names[:7] == [
        "nothing felt: zero", "constant", "plan", "replay",
        "lean felt: the law", "law and constant", "law and replay",
    ]  # fmt: skip
    both = ["policy on the law", "policy on the law, +0.2 cm"]
    assert names[-6:] == [*both, "lean felt: the law", "lean felt: the law, +0.2 cm", *both]
    assert [row[1] for row in found if row[0] in both] == ["2"] * 4

    def rise(config, *shifts):
        env = make_env(config.replace(randomization="disturbed"))
        rises = [
            run_episode(env, seed, constant_shift(*shift)).jump["flight_height"]
            for shift in shifts
            for seed in (3000, 3001)
        ]
        return f"{100 * np.nan_to_num(rises).mean():.2f}"

    unfelt = CONFIG.replace(lean_correction=False)
    by_name = {row[0]: row for row in found[:-4]}
    assert by_name["nothing felt: zero"][4] == rise(unfelt, (0.0, 0.0, 0.0))
    assert by_name["plan"][4] == rise(unfelt, (0.3, 0.0, 0.0))
    assert by_name["lean felt: the law"][4] == rise(CONFIG, (0.0, 0.0, 0.0))
    assert by_name["law and replay"][4] == rise(CONFIG, (0.1, 0.0, 0.0))  # of the best run
    ours = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0)
    assert by_name["policy on the law"][4] == rise(CONFIG, *ours)
    low, high = CONFIG.jump_heights
    asked = CONFIG.replace(jump_height=(low + 0.002, high + 0.002))
    assert by_name["policy on the law, +0.2 cm"][4] == rise(asked, *ours)


def test_without_more_height_each_arm_is_there_once_and_the_policies_last(small, monkeypatch):
    monkeypatch.setattr(arms, "MORE", {"velocity": 0.0})
    names = [arm.name for arm in arms.arms("velocity", 1, CONSOLE)]
    assert len(set(names)) == len(names)
    assert (names.count("lean felt: the law"), names[-1]) == (1, "policy on the law")
    assert not any("+0 cm" in name for name in names)


def test_trainings_that_are_missing_are_named(small):
    with pytest.raises(PolicyFileError, match=r"disturbed-torque-seed\*"):
        compare(ArmsOptions(controller="torque", episodes=2))


def test_what_is_asked_to_jump_higher_is_judged_by_the_command():
    config = CONFIG.replace(jump_height=0.05, randomization="none")
    asked = Arm("law", config, higher=0.01)
    ((episode,),) = asked.episodes(range(1), 1, CONSOLE)
    env = make_env(config.replace(jump_height=0.06))
    jump = run_episode(env, 0, BASELINE.policy).jump
    assert episode.jump["flight_height"] == pytest.approx(jump["flight_height"], abs=1e-6)
    assert episode.jump_height == pytest.approx(0.05)
    ratio = jump["flight_height"] / 0.06
    between = dataclasses.replace(CONFIG.success, height_ratio=min(1.0, 1.05 * ratio))
    strict = Arm("law", config.replace(success=between), higher=0.01)
    ((again,),) = strict.episodes(range(1), 1, CONSOLE)
    assert again.is_success  # by 5 cm, though not by 6


def means(success, rise):
    return np.array([[[success], [rise], [0.0]]])


@pytest.mark.parametrize(
    ("ours", "expected"),
    [
        ((80, 4.0), ["law, +0.5 cm, matched on success"]),  # the law itself is the best that high
        ((80, 4.6), ["law, +0.5 cm, matched on rise", "law, +0.5 cm, matched on success"]),
        ((70, 5.5), ["law, +1 cm, best in rise", "law, +1 cm, matched on success"]),
        ((95, 4.0), []),
    ],
)
def test_the_law_is_matched_with_the_policies(monkeypatch, ours, expected):
    asked = {0.0: (90, 4.5), 0.005: (85, 5.0), 0.01: (75, 5.2), -0.005: (60, 4.2)}

    def jumps(arm, *_):
        return means(*(asked[arm.higher] if arm.name != "ours" else ours))

    monkeypatch.setattr(Arm, "jumps", jumps)
    found = strongest(CONFIG, Arm("ours", CONFIG), 1, CONSOLE)
    assert [arm.name for arm in found] == expected


def test_replayed_actions_get_what_the_law_does_in_the_mean(monkeypatch):
    monkeypatch.setattr(arms, "TUNED_ON", range(4))
    actions = np.zeros((1, 2, 3), np.float32)
    actions[..., 2] = [0.0, -0.99]
    replay = ReplayPolicy(np.array([0.05], np.float32), actions, 100.0, AXES)
    config = CONFIG.replace(sensors="realistic")
    env, momenta = make_env(config), []
    for seed in range(4):
        env.reset(seed=seed)
        readings, stance = env._simulation.sensors.readings, env._controller.plan.stance
        momenta.append(lean_correction(readings.gravity, stance)[4])
    mean = np.mean(momenta) / config.residual.scale[4]
    assert 0 < mean < 1
    found = felt_by_none(replay, config).actions
    np.testing.assert_allclose(found[0, :, 2], [mean, mean - 0.99], rtol=0, atol=1e-6)
    assert not found[..., :2].any()


def test_gains_are_of_the_same_episodes_and_their_intervals_for_all_comparisons(rng):
    n = 300
    theirs = rng.integers(0, 2, (1, 3, n)).astype(float)
    gain = rng.integers(0, 3, (2, 3, n)).astype(float)
    compared = [Arm(name, CONFIG) for name in ("one", "other", "ours")]

    def cells(jumps):
        table = render(compared[-len(jumps) :], jumps, range(7000, 7500))
        return [list(column.cells) for column in table.columns]

    *_, soles, gains = cells([theirs, theirs, theirs + gain])
    values = [float(number) for number in re.findall(r"[+-][\d.]+", gains[0])]
    mean, low, high = values
    assert mean == pytest.approx(gain[:, 2].mean(), abs=0.006)
    assert soles[0] == f"{theirs[0, 2].mean():.2f}"
    assert gains[-1] == "-"
    alone = cells([theirs, theirs + gain])[-1][0]
    _, narrow_low, narrow_high = map(float, re.findall(r"[+-][\d.]+", alone))
    assert low < narrow_low < narrow_high < high


def test_what_always_does_the_same_wins_nothing_by_reacting(small, capsys):
    reacting.compare(ArmsOptions(episodes=2))
    _, theirs, ours = rows(capsys.readouterr().out)
    assert theirs[:2] == ["law and own mean action, +0.2 cm", "2"]
    assert theirs[2::2] == [*ours[2::2]]
    assert all(re.fullmatch(r"[+-](0\.0+) \([+-]\1 to [+-]\1\)", cell) for cell in theirs[3::2])


def test_policies_are_compared_with_their_own_mean_actions(rng):
    theirs = rng.normal(size=(2, 3, 40)) + np.array([0.0, 100.0])[:, None, None]
    arm = Arm("one", CONFIG)
    table = render([arm, arm], [theirs, theirs + 1.0], range(2), own=True)
    assert next(iter(table.columns[-1].cells)) == "+1.00 (+1.00 to +1.00)"
    table = render([arm, arm], [theirs, theirs + 1.0], range(2))
    assert next(iter(table.columns[-1].cells)) != "+1.00 (+1.00 to +1.00)"


def test_no_more_episodes_are_jumped_than_are_held_out():
    with pytest.raises(ConfigError, match="episodes"):
        ArmsOptions(episodes=501)
