"""The judged landings: which rows there are, and what is printed of them."""

import io
import re

import pytest
from rich.console import Console

from experiments import landing
from experiments.landing import AIMS, SERIES, judged, render, rows
from experiments.seeds import LANDING_TEST
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.modes.landing_study import LandingResult
from icub_jump_env.metrics.jump import JumpMetrics


def outcomes(pattern, **metrics):
    return [
        Episode(
            seed, 0.04, "stood", True, 0.0,
            {**JumpMetrics(**metrics).as_dict(), "landed": mark == "1"},
        )
        for seed, mark in enumerate(pattern)
    ]  # fmt: skip


CONFIGS = {name: JumpConfig.of(controller=name) for name in ("velocity", "torque")}


@pytest.mark.parametrize("controller", CONFIGS)
def test_each_aim_has_its_row(controller):
    found = rows(CONFIGS[controller])
    assert [(case.group, case.label) for case in found] == list(AIMS)
    assert len({CONFIGS[controller].replace(**case.changes) for case in found}) == len(AIMS)


def test_no_aim_is_below_its_must():
    for must, aim in AIMS.values():
        assert (must or 0) <= (100 if aim is None else aim) <= 100


def test_what_is_printed_of_a_row():
    case = next(c for c in rows(CONFIGS["torque"]) if c.label == "-4")
    ours = {"landing_force": 1500.0, "flight_height": 0.0432, "limit_violations": 7}
    result = LandingResult.of(
        case,
        {
            "hold": outcomes("0" * 10 + "1" * 10, landing_force=2000.0, flight_height=0.05),
            "feedback": outcomes("1" * 18 + "00", **ours),
        },
    )
    console = Console(file=io.StringIO(), width=200)
    console.print(render("torque", [result]))
    (row,) = re.findall(r"^ *floor tilt fore-aft -4 .*$", console.file.getvalue(), re.M)
    bounds = "69.9 to 97.2"
    assert row.split()[3:] == [
        *("-4", "85", "95", "50", "90"),
        *bounds.split(),
        *("+40.0", *row.split()[12:15], f"{result.against_hold['feedback'].p_value:.3f}"),
        *("-25", "4.32", "7"),
    ]


def test_hold_and_feedback_jump_the_same_held_out_seeds(monkeypatch):
    asked = {}
    monkeypatch.setattr(landing, "compare", lambda *arguments: asked.update(a=arguments))
    judged(2, Console())
    jumps, cases, variants, used, jobs, resume, _ = asked["a"]
    assert jumps == CONFIGS
    assert all(SERIES in found for found in cases.values())
    assert (variants, used, jobs, resume) == (("hold", "feedback"), LANDING_TEST, 2, True)
    assert [len(of_seeds) for of_seeds in used.values()] == [200, 200]
