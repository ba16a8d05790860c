"""``eval.py --max-height``: the highest plan that stands, and what binds there."""

import io
import json

import pytest
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.episodes.series import perturbed
from icub_jump_env.evaluation.modes import max_height
from icub_jump_env.evaluation.options import EvalOptions

SHORT = JumpConfig.of(stand_time=0.1)


@pytest.fixture
def twice(monkeypatch):
    monkeypatch.setattr(max_height, "REPETITIONS", 2)


def run(**options):
    console = Console(file=io.StringIO(), width=100)
    chosen = EvalOptions(config=options.pop("config", SHORT), max_height=True, **options)
    max_height.run(chosen, (), console, Console(file=io.StringIO()))
    return console.file.getvalue()


def test_the_command_prints_both_controllers(twice, tmp_path):
    out = run(json=tmp_path / "found.json", seed=3)
    assert out.split()[:5] == ["The", "highest", "plan", "that", "stands"]
    found = json.loads((tmp_path / "found.json").read_text())
    for place, controller in enumerate(("velocity", "torque")):
        config = SHORT.for_controller(controller).replace(planner="whole_body")
        family = config.plan_family
        env = make_env(perturbed(config.replace(jump_height=family.highest)))
        rises = [run_episode(env, seed).jump["flight_height"] for seed in (3, 4)]
        rise = f"{50 * sum(rises):.2f}"
        (row,) = [line for line in out.splitlines() if "plan that stands, cm" in line]
        assert row.split()[-2 + place] == rise
        (row,) = [line for line in out.splitlines() if "of the physical optimum" in line]
        share = 50 * sum(rises) / family.optimum
        assert row.split()[-2 + place] == f"{share:.0f}"
        (row,) = [line for line in out.splitlines() if "highest plan, cm" in line]
        assert row.split()[-2 + place] == f"{100 * family.card['plans'][-1]['height']:.2f}"
        assert found[controller]["plan"] == family.card["plans"][-1]
        assert found[controller]["share_of_optimum"] == pytest.approx(share / 100)
        for limit, (first, last) in family.card["plans"][-1]["binding"].items():
            (row,) = [line for line in out.splitlines() if line.strip().startswith(limit)]
            assert f"{first:.2f} to {last:.2f}" in row


def test_plans_that_the_robot_falls_with_do_not_count(twice, monkeypatch):
    """Only the third highest stands: with each of the higher ones a repetition falls."""
    family = SHORT.replace(planner="whole_body").plan_family
    run_all = max_height.run_all

    def falls(work, jobs, console):
        episodes = run_all(work, jobs, console)
        if work[0].config.jump_height > family.rise[-3]:
            episodes[1].jump["landed"] = False
        return episodes

    monkeypatch.setattr(max_height, "run_all", falls)
    console = Console(file=io.StringIO())
    found = max_height.highest_jump(
        SHORT.replace(planner="whole_body"), EvalOptions(max_height=True), console
    )
    assert found.member == len(family.rise) - 3


def test_the_largest_number_of_self_collisions_is_shown(twice, monkeypatch):
    run_all = max_height.run_all

    def touches(work, jobs, console):
        episodes = run_all(work, jobs, console)
        episodes[1].jump["self_collisions"] = 7.0
        return episodes

    monkeypatch.setattr(max_height, "run_all", touches)
    (row,) = [line for line in run().splitlines() if "self-collisions, steps" in line]
    assert row.split()[-2:] == ["7", "7"]


def test_a_file_of_plans_says_of_which_controller(twice, tmp_path):
    config = JumpConfig.of(controller="torque", planner="whole_body", stand_time=0.1)
    path = tmp_path / "mine.npz"
    config.plan_family.save(path)
    assert "velocity" not in run(config=config.replace(plans=path))
    with pytest.raises(ConfigError, match="max-height"):
        run(config=SHORT.for_controller("torque"))


def test_it_sets_command_and_worlds_itself():
    for changes in ({"jump_height": 0.05}, {"randomization": "full"}, {"com_displacement": 0.1}):
        with pytest.raises(ConfigError, match="--max-height, which varies it itself"):
            EvalOptions(config=SHORT.replace(**changes), max_height=True)
