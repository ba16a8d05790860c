"""Results of the benchmark: what counts, what is written, and what is refused."""

import hashlib
import json
import math

import pytest
from contenders import episode

from icub_jump_env.benchmark.cases import CASES, SUCCESS, succeeds
from icub_jump_env.benchmark.results import Result, Score
from icub_jump_env.errors import FileError
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.statistics.summary import Rate
from icub_jump_env.files import strict_json


def test_who_is_not_still_for_two_seconds_does_not_count():
    assert not succeeds(episode(0, still_time=1.9))
    assert succeeds(episode(0, still_time=2.1))
    assert not succeeds(episode(0, Failure.FELL_BACKWARD, still_time=2.1))


def test_a_score_tells_both_heights_and_why_jumps_failed():
    jumps = [
        episode(0, still_time=2.5, flight_height=0.04, apex_height=0.56),
        episode(1, still_time=0.5, flight_height=0.05, apex_height=0.58),
        episode(2, Failure.NO_TAKEOFF, still_time=2.5, flight_height=0.0, apex_height=math.nan),
    ]
    score = Score.of(jumps, standing=0.5)
    assert (score.success.count, score.success.total) == (1, 3)
    assert score.rise == pytest.approx(0.03)
    assert score.above_standing == pytest.approx(0.07)  # of the two that flew
    assert score.failures == {"no take-off": 1, "not still": 1}


def result(*counts, total=100):
    scores = {
        name: Score(Rate(count, total), 0.05, math.nan, {"too low": total - count})
        for name, count in zip(CASES, counts, strict=True)
    }
    return Result("mine", scores, {"versions": {"numpy": "2"}})


def test_the_total_is_the_mean_of_the_cases():
    mean, (low, high) = result(*range(10, 110, 10)).total
    assert mean == pytest.approx(0.55)
    assert low < 0.55 < high
    # Ten binomials of 100: the deviation of their mean.
    deviation = math.sqrt(sum(k / 10 * (1 - k / 10) / 100 for k in range(1, 11))) / 10
    assert high - low == pytest.approx(2 * 1.96 * deviation, rel=0.06)
    mean, (low, high) = result(*[100] * 10).total
    assert (mean, high) == (1.0, 1.0)
    assert 0.98 < low < 1.0


def test_what_is_written_is_read_back(tmp_path):
    written = result(*[90] * 10)
    written.write(tmp_path / "r.json")
    read = Result.read(tmp_path / "r.json")
    assert read.entry == "mine"
    assert read.total == written.total
    assert list(read.scores) == list(CASES)
    assert math.isnan(read.scores["low"].above_standing)
    assert read.scores["low"].failures == {"too low": 10}


def replaced(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda c: c["scores"]["low"]["success"].update(count=100), "hash"),
        (lambda c: c.pop("sha256"), "hash"),
    ],
)
@pytest.mark.fault("hostile results")
def test_a_changed_file_is_refused(tmp_path, change, problem):
    result(*[90] * 10).write(tmp_path / "r.json")
    replaced(tmp_path / "r.json", change)
    with pytest.raises(FileError, match=problem):
        Result.read(tmp_path / "r.json")


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda c: c.update(benchmark=2), "benchmark=2"),
        (lambda c: c.update(entry=5), "entry"),
        (lambda c: c["scores"].pop("low"), "cases"),
        (lambda c: c.update(scores=list(c["scores"])), "no result"),
        (lambda c: c["scores"]["low"]["success"].update(count=101), "count=101"),
        (lambda c: c["scores"]["low"]["success"].update(count=1, total=1), "total=1"),
        (lambda c: c["scores"]["low"].update(failures=["too low"]), "no result"),
        (lambda c: c["scores"]["low"].update(rise="high"), "rise"),
    ],
)
@pytest.mark.fault("hostile results")
def test_a_file_with_a_true_hash_may_still_be_no_result(tmp_path, change, problem):
    result(*[90] * 10).write(tmp_path / "r.json")
    content = json.loads((tmp_path / "r.json").read_text())
    content.pop("sha256")
    change(content)
    content["sha256"] = hashlib.sha256(strict_json(content).encode()).hexdigest()
    (tmp_path / "r.json").write_text(json.dumps(content))
    with pytest.raises(FileError, match=problem):
        Result.read(tmp_path / "r.json")


@pytest.mark.parametrize(
    "content",
    ["", "[]", "{}", '{"benchmark": 1}', "[" * 1000, "\x00", "9" * 5000, '"' + "x" * 2**20],
)
@pytest.mark.fault("hostile results")
def test_what_is_no_result_is_refused_with_its_name(tmp_path, content):
    (tmp_path / "r.json").write_text(content)
    with pytest.raises(FileError, match=r"r\.json"):
        Result.read(tmp_path / "r.json")


def test_success_is_stricter_than_the_environment():
    assert (SUCCESS.flight_time, SUCCESS.height_ratio, SUCCESS.stand_time) == (0.1, 0.9, 3.0)
