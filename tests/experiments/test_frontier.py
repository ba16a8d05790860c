"""The strongest baselines: how they are chosen, and what the command prints."""

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from agents.options import TASK
from experiments import frontier, shipped
from experiments.frontier import FrontierOptions, Point, judged, run_frontier, strongest
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


class TestStrongest:
    def test_the_highest_as_successful_and_the_most_successful_as_high(self):
        sure, surer = point(0.94, 0.047), point(1.0, 0.045)  # 0.94 is not told from 0.95 here
        high, higher = point(0.8, 0.0501), point(0.7, 0.055)  # nor 5.01 cm from 5.1
        assert strongest([surer, higher, high, sure], POLICY) == {
            "as successful a baseline": sure, "as high a baseline": high,
        }  # fmt: skip

    def test_one_may_be_both(self):
        better, worse = point(0.97, 0.052), point(0.96, 0.0515)
        assert list(strongest([worse, better], POLICY).values()) == [better, better]

    def test_where_none_comes_near(self):
        low, lower, bad = point(0.9, 0.049), point(0.9, 0.048), point(0.5, 0.0495)
        assert strongest([lower, low, bad], POLICY) == {
            "most successful baseline": low, "highest baseline": bad,
        }  # fmt: skip


@pytest.fixture
def small(monkeypatch):
    task = TASK.replace(stand_time=0.1)
    monkeypatch.setattr(shipped, "TASK", task)
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
    assert "\nseeds 3000 to 3002\npolicy, 6 cm after 9 cm: success " in out
    assert len(re.findall(r"baseline, [46] cm after 10 cm: success .* of 3; .*, rise", out)) == 2
    assert "\nconstant shift, 6 cm after 9 cm: success " in out
    for who, times in ("policy", 3), ("constant shift", 2):
        pattern = f"^  {who} against it: success .* McNemar .*, rise"
        assert len(re.findall(pattern, out, re.MULTILINE)) == times
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
