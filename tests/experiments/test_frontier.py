"""The strongest baselines: how they are chosen, and what the command prints."""

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from agents.options import TASK
from experiments import frontier
from experiments.frontier import FrontierOptions, Point, judged, rivals, run_frontier
from experiments.rivals import constant_shift
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.contender import BASELINE
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.statistics import intervals
from icub_jump_env.metrics.jump import JumpMetrics, SuccessConfig
from icub_jump_env.policy import save_policy


def point(success, rise, command=0.06):
    summary = SimpleNamespace(success=SimpleNamespace(share=success), mean_rise=rise)
    return Point(BASELINE, command, 0.09, summary)


POLICY = point(0.95, 0.051)


class TestRivals:
    def test_each_rule_chooses_with_and_without_its_slack(self):
        sure, surer = point(0.94, 0.047), point(1.0, 0.045)  # 1 point below the policy
        high, higher = point(0.8, 0.0501), point(0.7, 0.055)  # 0.9 mm below the policy
        assert rivals([surer, higher, high, sure], POLICY) == {
            "matched on success": surer, "matched on success within 2 points": sure,
            "matched on rise": higher, "matched on rise within 1 mm": high,
        }  # fmt: skip

    def test_of_those_that_are_matched_the_best_in_the_other_measure(self):
        better, worse = point(0.97, 0.052), point(0.96, 0.0515)
        assert list(rivals([worse, better], POLICY).values()) == [better] * 4

    def test_where_none_is_matched(self):
        low, lower, bad = point(0.9, 0.049), point(0.9, 0.048), point(0.5, 0.0495)
        assert rivals([lower, low, bad], POLICY) == {
            "most successful, as none is matched on success": low,
            "most successful, as none is matched on success within 2 points": low,
            "highest, as none is matched on rise": bad,
            "highest, as none is matched on rise within 1 mm": bad,
        }


@pytest.fixture
def small(monkeypatch):
    task = TASK.replace(stand_time=0.1)
    for name, value in {
        "COMMANDS": (0.04, 0.06), "DISPLACEMENTS": (0.1,),
        "TEST": range(3000, 3003), "_GRID_SEEDS": range(2), "SHIPPED": Path("shipped"),
    }.items():  # fmt: skip
        monkeypatch.setattr(frontier, name, value)
    monkeypatch.setattr(intervals, "_RESAMPLES", 200)
    Path("shipped").mkdir()
    for name, shift in (("velocity", 0.0), ("velocity-constant", 0.2)):
        save_policy(
            f"shipped/{name}.safetensors", constant_shift(shift, 0.0), config=task, versions={},
            command=("python", "x"), seed=None, results={},
        )  # fmt: skip


def test_the_command_prints_the_grid_and_the_meeting(small, capsys):
    run_frontier(FrontierOptions(plot=Path("pictures")))
    out = capsys.readouterr().out
    rows = re.findall(
        r"^ (\d)  +(baseline|velocity|velocity-constant) +(9|10) +", out, re.MULTILINE
    )
    cells = ("baseline", "10"), ("velocity-constant", "9"), ("velocity", "9")
    assert rows == [(command, *cell) for command in "46" for cell in cells]
    assert re.search("^ ?seeds 0 to 1; success: landed after at least 4.2 cm", out, re.MULTILINE)
    assert "\nheld-out seeds 3000 to 3002\npolicy, 6 cm after 9 cm: success " in out
    assert "\nconstant shift, 6 cm after 9 cm: success " in out
    met = re.findall(r"^(baseline, [46] cm after 10 cm) \((.*)\): success .* of 3; ", out, re.M)
    rules = [rule for _, names in met for rule in names.split("; ")]
    assert len(rules) == 4
    assert [re.search("on (success|rise)(.*)", rule).groups() for rule in rules] == [
        ("success", ""), ("success", " within 2 points"), ("rise", ""), ("rise", " within 1 mm"),
    ]  # fmt: skip
    pairs = re.findall(r"^(.*) against (.*): success .* corrected p .* rise", out, re.M)
    rivals_met = [name for name, _ in met]
    assert pairs == [
        ("policy", "constant shift"),
        *((who, name) for name in rivals_met for who in ("policy", "constant shift")),
    ]
    assert f"\ncorrected p: Holm-corrected over {len(pairs)} comparisons\n" in out
    assert Path("pictures/frontier.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_written_is_refused_first(small, monkeypatch):
    monkeypatch.setattr(frontier, "Series", None)
    with pytest.raises(ConfigError, match="plot"):
        run_frontier(FrontierOptions(plot=Path("shipped/velocity.json")))


@pytest.mark.parametrize(
    ("rise", "landed", "time", "success"),
    [
        (0.0421, True, 0.2, True),
        (0.0419, True, 0.2, False),
        (0.06, False, 0.2, False),
        (0.06, True, 0.09, False),
    ],
)
@pytest.mark.parametrize("command", [0.04, 0.08])
def test_all_are_judged_by_the_policys_command(command, rise, landed, time, success):
    jump = {
        "flight_height": rise, "landed": landed, "flight_time": time,
        "flight_rotation": 0.0, "sole_slip": 0.0, "chest_lean": (0.1, 0.0),
    }  # fmt: skip
    episode = Episode(7, command, "stood", not success, 0.0, jump)
    found = judged(episode)
    assert found == dataclasses.replace(episode, jump_height=0.06, is_success=success)
    jumped = JumpMetrics(flight_height=rise, landed=landed, flight_time=time)
    assert success == jumped.is_success(0.06, SuccessConfig())
