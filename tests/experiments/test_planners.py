"""The planners against each other: what is jumped, counted and printed."""

import dataclasses
import io
import re

import pytest
from rich.console import Console

from experiments import planners
from experiments.planners import PlannerOptions, Point, cases, render, render_pairs, run_planners
from experiments.seeds import PLANNER_TEST, SELECTION, TEST, TUNING
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.statistics import intervals
from icub_jump_env.metrics.jump import JumpMetrics


def point(landings, planner="whole_body", height=0.05, displacement=None, **metrics):
    jump = {**JumpMetrics(flight_height=0.05).as_dict(), **metrics}
    episodes = tuple(
        Episode(seed, height, "stood", bool(landed), 0.0, jump)
        for seed, landed in enumerate(landings)
    )
    return Point("torque", "hard", planner, height, displacement, episodes)


def printed(table):
    console = Console(file=io.StringIO(), width=120)
    console.print(table)
    return console.file.getvalue()


def test_the_held_out_seeds_are_held_out():
    for others in (TUNING, TEST, SELECTION):
        assert not set(PLANNER_TEST) & set(others)


def test_every_low_command_has_its_pair():
    for controller in ("velocity", "torque"):
        found = cases(controller)
        for height in planners.LOW:
            assert ("scaled_curve", height, planners.PAPER_DISPLACEMENT) in found
            assert ("whole_body", height, None) in found


def test_pairs_are_counted_by_landings_at_the_same_command():
    ours = point([1, 1, 1, 0])
    points = [
        ours,
        point([1, 0, 0, 1], "scaled_curve", displacement=0.11),
        point([0, 0, 0, 0], "scaled_curve", displacement=0.08),
        point([0, 0, 0, 0], "scaled_curve", height=0.04, displacement=0.11),
        dataclasses.replace(point([0, 0, 0, 0], "scaled_curve", displacement=0.11), world="full"),
    ]
    (row,) = re.findall(
        r"torque +hard +5 +(\S+) .* (\d) +(\d) +(\S+) *$", printed(render_pairs(points)), re.M
    )
    assert row == ("+25.0", "2", "1", "1.000")


def test_jumps_with_anything_counted_are_shown():
    clean, dirty = point([1, 1, 0]), point([1, 1, 1], limit_violations=3.0)
    mixed = dataclasses.replace(clean, episodes=clean.episodes[:2] + dirty.episodes[:2])
    out = printed(render([mixed], "title"))
    (row,) = re.findall(r"whole_body +5 +- +100 .* 5.00 +5.00 to 5.00 +(\d+) +(\d+)", out)
    assert row == ("50", "0")


def test_the_command_prints_every_world_and_draws(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(intervals, "_RESAMPLES", 200)
    monkeypatch.setattr(planners, "TUNING", range(2))
    monkeypatch.setattr(planners, "WORLDS", ("full",))
    monkeypatch.setattr(
        planners,
        "cases",
        lambda _: [("scaled_curve", 0.04, 0.11), ("whole_body", 0.04, None)],
    )
    monkeypatch.setattr(planners, "UNTUNED", (0.0437,))
    monkeypatch.setattr(planners, "_NOMINAL_JUMPS", 2)
    run_planners(PlannerOptions(plot=tmp_path))
    out = capsys.readouterr().out
    for controller in ("velocity", "torque"):
        assert f"{controller} controller, full, seeds 0 to 1" in out
    (row,) = re.findall(r"^ 4.37 +(\S+) +(\S+) +100 *$", out, re.M)
    errors = [abs(float(rise) - 4.37) for rise in row]
    assert max(errors) < 0.3
    assert f"largest error {max(errors):.2f} cm" in " ".join(out.split())
    assert out.count("scaled_curve") == out.count("whole_body") == 2
    assert (tmp_path / "planners.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("judge", [False, True])
def test_held_out_seeds_only_when_asked(judge, monkeypatch):
    used = []

    def jumps(controller, world, planner, height, displacement, seeds, jobs, progress):
        used.append(seeds)
        return dataclasses.replace(
            point([1, 1], planner, height, displacement), controller=controller, world=world
        )

    monkeypatch.setattr(planners, "jumps", jumps)
    monkeypatch.setattr(planners, "UNTUNED", (0.05,))
    monkeypatch.setattr(planners, "_NOMINAL_JUMPS", 1)
    run_planners(PlannerOptions(judge=judge))
    assert set(used) == {PLANNER_TEST if judge else TUNING}
