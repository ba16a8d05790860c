"""The log of a series on disk: what it survives, and how it is gone on with."""

import dataclasses
import io
import json
import os
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path

import psutil
import pytest
from contenders import episode
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.parallel import run_jobs
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.files import strict_json
from icub_jump_env.metrics.jump import JumpMetrics

REPOSITORY = Path(__file__).parents[2]

FAST = ["--randomization", "full", "--stand-time", "0.0"]
QUIET = Console(file=io.StringIO())


class TestLog:
    header = {"config": {"jump_height": 0.04, "solver": "daqp"}, "episodes": 3}  # noqa: RUF012

    def test_episodes_survive_the_disk(self, tmp_path):
        written = [episode(0, flight_height=0.1 + 0.2), episode(1, Failure.SLIPPED)]
        log = EpisodeLog(tmp_path / "new" / "log.jsonl", self.header, resume=False)
        for e in written:
            log.append(e)
        again = EpisodeLog(log.path, self.header, resume=True)
        assert list(again.episodes.values()) == written
        assert again.episodes[1].failure is Failure.SLIPPED
        assert isinstance(again.episodes[0].jump["angular_momentum_takeoff"], tuple)

    def test_a_line_cut_off_is_dropped(self, tmp_path):
        log = EpisodeLog(tmp_path / "log.jsonl", self.header, resume=False)
        log.append(episode(0))
        with log.path.open("a") as file:
            file.write('{"seed": 1, "outc')
        again = EpisodeLog(log.path, self.header, resume=True)
        assert set(again.episodes) == {0}
        again.append(episode(1))
        assert set(EpisodeLog(log.path, self.header, resume=True).episodes) == {0, 1}

    def test_finished_logs_do_not_depend_on_the_order(self, tmp_path):
        contents = []
        for order in ((0, 1, 2), (2, 0, 1)):
            log = EpisodeLog(tmp_path / f"{order[0]}.jsonl", self.header, resume=False)
            for seed in order:
                log.append(episode(seed))
            log.finish()
            contents.append(log.path.read_bytes())
        assert contents[0] == contents[1]

    def test_an_existing_log_is_kept(self, tmp_path):
        path = tmp_path / "log.jsonl"
        for seed in range(3):
            log = EpisodeLog(path, self.header, resume=False)
            log.append(episode(seed))
        assert log.kept == tmp_path / "log.2.jsonl"
        assert set(EpisodeLog(path, self.header, resume=True).episodes) == {2}
        for seed in range(2):
            kept = EpisodeLog(tmp_path / f"log.{seed + 1}.jsonl", self.header, resume=True)
            assert set(kept.episodes) == {seed}

    def test_another_question_is_refused_by_name(self, tmp_path):
        path = tmp_path / "log.jsonl"
        EpisodeLog(path, self.header, resume=False).append(episode(0))
        before = path.read_bytes()
        other = {"config": {"jump_height": 0.05, "solver": "daqp"}, "episodes": 4}
        with pytest.raises(ConfigError, match=r"different: config\.jump_height, episodes"):
            EpisodeLog(path, other, resume=True)
        assert path.read_bytes() == before

    @pytest.mark.parametrize("content", ["", "nonsense\n", "[1]\n", '{"a": 1}\n{"b": 2}\n'])
    @pytest.mark.fault("damaged files")
    def test_another_file_is_refused_and_kept(self, tmp_path, content):
        path = tmp_path / "notes.txt"
        path.write_text(content)
        for resume in (True, False):
            with pytest.raises(ConfigError, match=r"a log of eval\.py"):
                EpisodeLog(path, self.header, resume=resume)
        assert path.read_text() == content
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.parametrize(
        "change",
        [
            {"seed": "1"}, {"is_success": "no"}, {"jump": {}}, {"failure": "tired"},
            {"jump": {**JumpMetrics().as_dict(), "flight_height": "high"}},
            {"jump": {**JumpMetrics().as_dict(), "landed": None}},
            {"jump_height": None}, {"jump_height": [0.04, 0.06]}, {"reward": None},
        ],
    )  # fmt: skip
    @pytest.mark.fault("damaged files")
    def test_damaged_episodes_are_dropped(self, tmp_path, change):
        """Whether the line was changed, or written so with a checksum that fits."""
        log = EpisodeLog(tmp_path / "log.jsonl", self.header, resume=False)
        log.append(episode(0))
        header, line = log.path.read_text().splitlines()
        entry = json.loads(line)
        del entry["crc32"]
        rest = strict_json(entry | change)[:-1]
        seal = f', "crc32": "{zlib.crc32(rest.encode()):08x}"}}'
        assert line == f"{strict_json(entry)[:-1]}{line[-len(seal) :]}"
        for damaged in (strict_json(json.loads(line) | change), rest + seal):
            log.path.write_text(f"{header}\n{damaged}\n{line}\n{damaged}\n")
            again = EpisodeLog(log.path, self.header, resume=True)
            assert (again.damaged, again.episodes) == (2, {0: episode(0)})
            assert log.path.read_text() == f"{header}\n{line}\n"

    @pytest.mark.fault("damaged files")
    def test_one_changed_character_is_noticed_wherever_it_is(self, tmp_path):
        log = EpisodeLog(tmp_path / "log.jsonl", self.header, resume=False)
        log.append(episode(0))
        header, line = log.path.read_bytes().splitlines()
        for place in range(0, len(line), 37):
            changed = line[:place] + bytes([line[place] ^ 1]) + line[place + 1 :]
            log.path.write_bytes(header + b"\n" + changed + b"\n")
            again = EpisodeLog(log.path, self.header, resume=True)
            assert (again.damaged, again.episodes) == (1, {})
        for place in range(0, len(header), 7):
            changed = header[:place] + bytes([header[place] ^ 1]) + header[place + 1 :]
            log.path.write_bytes(changed + b"\n" + line + b"\n")
            with pytest.raises(ConfigError, match=r"a log of eval\.py"):
                EpisodeLog(log.path, self.header, resume=True)

    @pytest.mark.fault("damaged files")
    def test_a_line_nested_without_end_is_dropped(self, tmp_path):
        log = EpisodeLog(tmp_path / "log.jsonl", self.header, resume=False)
        for levels in (500, 100_000):
            rest = '{"a": ' + "[" * levels + "]" * levels
            seal = f', "crc32": "{zlib.crc32(rest.encode()):08x}"}}'
            with log.path.open("a") as file:
                file.write(f"{rest}{seal}\n")
        assert EpisodeLog(log.path, self.header, resume=True).damaged == 2

    def test_bytes_that_are_no_text_are_refused(self, tmp_path):
        path = tmp_path / "log.jsonl"
        path.write_bytes(b"\xff\xfe\n")
        with pytest.raises(ConfigError, match=r"a log of eval\.py"):
            EpisodeLog(path, self.header, resume=True)

    def test_episodes_of_other_seeds_are_refused(self, tmp_path):
        log = EpisodeLog(tmp_path / "log.jsonl", self.header, resume=False)
        log.append(episode(7))
        with pytest.raises(ConfigError, match="different: seeds"):
            EpisodeLog(log.path, self.header, resume=True)

    def test_with_nothing_to_resume_it_begins(self, tmp_path):
        log = EpisodeLog(tmp_path / "log.jsonl", self.header, resume=True)
        log.append(episode(0))
        assert set(EpisodeLog(log.path, self.header, resume=True).episodes) == {0}


STOPS = """
import sys, time
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.episodes import series

def run_jobs(work, jobs, run=series.run_jobs):
    for number, result in enumerate(run(work, jobs)):
        if number == 2:
            time.sleep(1000)
        yield result

if __name__ == "__main__":
    series.run_jobs = run_jobs
    cli.evaluate(sys.argv[1:])
"""
"""eval.py that makes no progress after two episodes, however slow the machine is."""


@pytest.mark.parametrize(
    ("jobs", "signals"),
    [("1", [signal.SIGINT]), ("2", [signal.SIGTERM, signal.SIGKILL])],
)
@pytest.mark.fault("killed evaluations")
def test_killed_and_resumed_equals_uninterrupted(tmp_path, jobs, signals):
    """The real thing: signals to a process, and the files compared byte for byte."""
    program = tmp_path / "stops.py"
    program.write_text(STOPS)
    whole, parts = tmp_path / "whole.jsonl", tmp_path / "parts.jsonl"
    arguments = ["--sensors", "realistic", "--episodes", "7", "--results"]
    cli.evaluate([*FAST, *arguments, str(whole)])
    for number, interruption in enumerate(signals):
        lines = 1 + 2 * (number + 1)
        resume = ["--resume"] if number else []
        with subprocess.Popen(
            [sys.executable, str(program), *FAST, *arguments, str(parts), "--jobs", jobs, *resume],
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            while not parts.exists() or len(parts.read_text().splitlines()) < lines:
                assert process.poll() is None, process.stderr.read()
                time.sleep(0.01)
            children = psutil.Process(process.pid).children(recursive=True)
            assert len(children) >= int(jobs) - 1
            process.send_signal(interruption)
            _, err = process.communicate(timeout=60)
        assert not psutil.wait_procs(children, timeout=60)[1]
        if interruption == signal.SIGKILL:
            assert process.returncode == -signal.SIGKILL
        else:
            assert process.returncode == 130
            kept = f"{lines - 1} of 7 episodes are in {parts}; add --resume to the command"
            assert err == f"{kept} to finish\ninterrupted\n"
    cli.evaluate([*FAST, *arguments, str(parts), "--resume"])
    assert parts.read_bytes() == whole.read_bytes()


def test_the_default_log_is_another_one_after_the_code_has_changed(monkeypatch):
    series = Series(JumpConfig(), range(3))
    before = series.default_log()
    assert before == series.default_log()
    monkeypatch.setattr("icub_jump_env.evaluation.episodes.series.source", lambda: "of tomorrow")
    assert series.default_log() != before


def test_a_series_is_completed_from_its_log(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    series = Series(JumpConfig.of(stand_time=0.0), range(2))
    episodes = series.complete(1, QUIET)
    assert [episode.seed for episode in episodes] == [0, 1]
    monkeypatch.setattr(
        "icub_jump_env.evaluation.episodes.series.run_jobs", lambda work, jobs: run_jobs((), jobs)
    )
    assert series.complete(1, QUIET) == episodes


def test_the_default_log_is_another_one_after_the_plans_have_changed(tmp_path):
    config = JumpConfig.of(planner="whole_body")
    family = config.plan_family
    family.save(tmp_path / "mine.npz")
    series = Series(config.replace(plans=tmp_path / "mine.npz"), range(2))
    before = series.default_log()
    assert before == series.default_log()
    dataclasses.replace(family, retraction=family.retraction + 0.01).save(tmp_path / "mine.npz")
    assert series.default_log() != before
