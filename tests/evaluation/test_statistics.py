"""Rates, percentiles, the log on disk, resuming, replaying."""

import json
import shlex
from pathlib import Path

import pytest
from contenders import episode

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.episodes import series
from icub_jump_env.evaluation.episodes.contender import BASELINE
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.figures.statistics import statistics_figure
from icub_jump_env.evaluation.modes import statistics
from icub_jump_env.evaluation.modes.statistics import replay_arguments
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.planning.residual import ResidualConfig
from icub_jump_env.simulation.randomization import Randomization

FAST = ["--randomization", "full", "--stand-time", "0.0"]


def evaluate(capsys, *arguments):
    code = 0
    try:
        cli.evaluate([*FAST, *arguments])
    except SystemExit as end:
        code = end.code
    captured = capsys.readouterr()
    return code, captured.out, captured.err


class TestCommand:
    def test_prints_rates_metrics_and_failures_and_writes_json(self, capsys, tmp_path):
        report, log = tmp_path / "r.json", tmp_path / "log.jsonl"
        code, out, _ = evaluate(
            capsys, "--episodes", "3", "--seed", "5", "--json", str(report), "--results", str(log)
        )
        assert code == 0
        for words in ("landed and stands: 100.0 % (3 of 3; 95 % interval 43.9 to 100.0 %)",
                      "mean rise: 3.", "success:", "10 %", "median", "flight height", "seeds 5 to 7"):  # fmt: skip
            assert words in out
        content = json.loads(report.read_text(), parse_constant=pytest.fail)
        assert content["landed"]["count"] == 3
        assert content["config"]["randomization"] == "full"
        episodes = [json.loads(line) for line in log.read_text().splitlines()[1:]]
        assert [e["seed"] for e in episodes] == [5, 6, 7]
        assert len({e["world"]["friction"] for e in episodes}) == 3

    def test_interrupted_and_resumed_equals_uninterrupted(self, capsys, tmp_path, monkeypatch):
        whole, parts = tmp_path / "whole.jsonl", tmp_path / "parts.jsonl"
        _, expected, _ = evaluate(capsys, "--episodes", "4", "--results", str(whole))

        run_jobs = series.run_jobs

        def interrupted(work, jobs):
            for number, result in enumerate(run_jobs(work, jobs)):
                if number == 2:
                    raise KeyboardInterrupt
                yield result

        monkeypatch.setattr(series, "run_jobs", interrupted)
        code, out, err = evaluate(capsys, "--episodes", "4", "--results", str(parts))
        assert code == 130
        assert out == ""
        assert f"2 of 4 episodes are in {parts}" in err
        assert "--resume" in err
        assert len(parts.read_text().splitlines()) == 3

        asked = []

        def watched(work, jobs):
            asked.extend(job.seed for job in work)
            return run_jobs(work, jobs)

        monkeypatch.setattr(series, "run_jobs", watched)
        code, out, _ = evaluate(capsys, "--episodes", "4", "--results", str(parts), "--resume")
        assert code == 0
        assert asked == [2, 3]
        assert out == expected
        assert parts.read_bytes() == whole.read_bytes()

    def test_a_damaged_episode_is_jumped_again(self, capsys, tmp_path, monkeypatch):
        log = tmp_path / "log.jsonl"
        asked = ("--episodes", "3", "--results", str(log))
        _, expected, _ = evaluate(capsys, *asked)
        whole = log.read_bytes()
        log.write_bytes(
            whole.replace(b'"seed": 1, "jump_height": 0.04', b'"seed": 1, "jump_height": 0.05')
        )
        assert log.read_bytes() != whole
        seeds, run_jobs = [], series.run_jobs

        def watched(work, jobs):
            seeds.extend(job.seed for job in work)
            return run_jobs(work, jobs)

        monkeypatch.setattr(series, "run_jobs", watched)
        code, out, err = evaluate(capsys, *asked, "--resume")
        assert (code, out, seeds) == (0, expected, [1])
        assert f"dropped 1 damaged line of {log}: what is missing is jumped again\n" in err
        assert log.read_bytes() == whole

    def test_a_finished_evaluation_resumes_to_the_same_table_at_once(self, capsys, monkeypatch):
        _, expected, _ = evaluate(capsys, "--episodes", "2")
        run_jobs = series.run_jobs

        def nothing_to_do(work, jobs):
            assert not work
            return run_jobs(work, jobs)

        monkeypatch.setattr(series, "run_jobs", nothing_to_do)
        _, out, _ = evaluate(capsys, "--episodes", "2", "--resume")
        assert out == expected

    def test_failures_can_be_replayed_by_their_seed(self, capsys, tmp_path):
        """A world in which the jump fails, found by the evaluation and run again alone."""
        log = tmp_path / "log.jsonl"
        hopeless = ["--randomization", "full", "--momentum-control", "False", "--stand-time", "1"]
        cli.evaluate([*hopeless, "--episodes", "2", "--results", str(log)])
        out = capsys.readouterr().out
        assert "over-rotated: 2 (seeds 0, 1)" in out
        command = next(line for line in out.splitlines() if "replay" in line).split("eval.py ")[1]
        options = cli.parse(EvalOptions, shlex.split(command))
        assert options.view
        env = make_env(options.config)
        replayed = run_episode(env, options.seed)
        header = json.loads(log.read_text().splitlines()[0])
        del header["crc32"]
        recorded = EpisodeLog(log, header, resume=True).episodes[options.seed]
        assert replayed == recorded

    @pytest.mark.parametrize("landed", [True, False])
    def test_of_a_single_episode_its_values_are_shown(self, landed):
        done = [episode(7, None if landed else Failure.SLIPPED, flight_height=0.0412)]
        options = EvalOptions(JumpConfig.of(randomization="full"), seed=7)
        title, table, lines = statistics.render(done, options, BASELINE)
        assert title.endswith("randomization full, seed 7")
        assert [column.header for column in table.columns] == ["", "value"]
        assert next(iter(table.columns[1].cells)) == "4.12"
        words = {True: "yes", False: "no"}[landed]
        expected = [f"landed and stands: {words}", f"success: {words}"]
        if not landed:
            expected += ["failure: slipped"]
        assert lines[: len(expected)] == expected


class TestRangeOfCommands:
    def test_every_episode_jumps_its_own(self, capsys, tmp_path):
        arguments = [
            "--jump-height", "0.03", "0.05", "--stand-time", "0.0", "--episodes", "3",
            "--json", "r.json", "--plot", "figures",
        ]  # fmt: skip
        cli.evaluate(arguments)
        captured = capsys.readouterr()
        assert "3 to 5 cm jump, velocity controller, baseline" in captured.out
        assert "alike" not in captured.err
        assert json.loads(Path("r.json").read_text())["config"]["jump_height"] == [0.03, 0.05]
        assert Path("figures/statistics.png").stat().st_size > 10_000
        (log,) = Path("results").iterdir()
        assert log.name.startswith("velocity-baseline-3to5cm-none-")
        lines = [json.loads(line) for line in log.read_text().splitlines()[1:]]
        heights = [line["jump_height"] for line in lines]
        env = make_env(JumpConfig.of(jump_height=(0.03, 0.05)))
        assert heights == [env.reset(seed=seed)[1]["jump_height"] for seed in range(3)]
        for seed, line in enumerate(lines):
            alone = make_env(JumpConfig.of(jump_height=heights[seed], stand_time=0.0))
            assert line["jump"]["flight_height"] == run_episode(alone, seed).jump["flight_height"]

        cli.evaluate([*arguments, "--resume"])
        assert capsys.readouterr().out == captured.out

    @pytest.mark.parametrize("heights", [["0.04"], ["0.04", "0.04"]])
    def test_episodes_that_are_all_alike_are_pointed_out(self, capsys, heights):
        cli.evaluate(["--jump-height", *heights, "--stand-time", "0.0", "--episodes", "2"])
        captured = capsys.readouterr()
        assert "4 cm jump" in captured.out
        assert "all episodes will be alike" in captured.err

    def test_one_episode_of_it_is_no_nominal_jump(self):
        assert EvalOptions(JumpConfig.of(jump_height=(0.03, 0.05))).mode == "statistics"
        assert EvalOptions(JumpConfig.of(jump_height=0.03)).mode == "nominal"

    def test_the_log_is_that_of_its_range(self, tmp_path):
        paths = {
            series.Series(JumpConfig.of(jump_height=heights), range(2)).default_log()
            for heights in (0.03, (0.03, 0.03), (0.03, 0.05), (0.03, 0.050000001))
        }
        assert len(paths) == 4

    def test_the_line_that_replays_a_failure_has_its_command(self):
        config = JumpConfig.of(jump_height=(0.03, 0.05))
        episodes = [
            episode(seed, failure, jump_height=height, flight_height=0.02)
            for seed, failure, height in ((0, None, 0.03), (1, Failure.TOO_LOW, 0.1 + 0.2 - 0.25))
        ]
        *_, lines = statistics.render(episodes, EvalOptions(config, episodes=2), BASELINE)
        command = lines[-1].partition("eval.py ")[2]
        options = cli.parse(EvalOptions, shlex.split(command))
        assert options == EvalOptions(
            JumpConfig.of(jump_height=0.1 + 0.2 - 0.25), seed=1, view=True
        )


class TestFigure:
    """What the picture shows, read from the picture."""

    @staticmethod
    def axis(heights):
        episodes = [
            episode(seed, jump_height=height, flight_height=0.9 * height, flight_rotation=0.1)
            for seed, height in enumerate(heights)
        ]
        lost = episode(9, Failure.TOO_LOW, jump_height=heights[0], flight_height=0.01)
        (axis,) = statistics_figure([*episodes, lost], SuccessConfig(height_ratio=0.6)).axes
        lines = {line.get_label(): line for line in axis.lines}
        assert list(lines) == [f"success: {len(heights)}", "too low: 1", "command",
                               "least for a success"]  # fmt: skip
        assert [text.get_text() for text in axis.get_legend().get_texts()] == list(lines)
        return axis, [line.get_xdata() for line in lines.values()]

    def test_of_one_command_in_centimetres(self):
        axis, (successes, low, command, least) = self.axis([0.04, 0.04])
        assert axis.get_xlabel() == "CoM rise (cm)"
        assert list(successes) == pytest.approx([3.6, 3.6])
        assert list(low) == pytest.approx([1.0])
        assert command == [4.0, 4.0]
        assert least == pytest.approx([2.4, 2.4])

    def test_of_several_commands_in_units_of_each(self):
        axis, (successes, low, command, least) = self.axis([0.03, 0.05])
        assert axis.get_xlabel() == "CoM rise / commanded height"
        assert list(successes) == pytest.approx([0.9, 0.9])
        assert list(low) == pytest.approx([0.01 / 0.03])
        assert command == [1.0, 1.0]
        assert least == [0.6, 0.6]


def test_replay_arguments_give_the_configuration_back():
    for config in (
        JumpConfig(),
        JumpConfig.of(jump_height=(0.03, 0.1 + 0.2 - 0.25)),
        JumpConfig.of(
            controller="torque", momentum_control=False, residual_scale=(0.01, 0.02, 0.03),
            randomization=Randomization(friction=(0.3, 0.5)), sensors="realistic",
            control_frequency=250.0, agent_frequency=50.0,
        ),
        JumpConfig.of(
            ankle_shift=False, stand_time=0.3, constraints="hard", launch_end="lift_off",
            residual=ResidualConfig(bandwidth=20.0), success=SuccessConfig(0.05, 0.5, 1.0),
        ),
    ):  # fmt: skip
        options = cli.parse(EvalOptions, shlex.split(replay_arguments(config, 7)))
        assert options.config == config
        assert options.seed == 7
    assert replay_arguments(JumpConfig.of(residual_phases="all", jump_height=0.05), 7) == (
        "--jump-height 0.05 --residual.phases all --seed 7"
    )
