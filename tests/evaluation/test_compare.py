"""``eval.py --compare``: pairs of episodes, and what follows from them."""

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from contenders import FEEDBACK, episode, evaluate, save, save_constant
from matplotlib import rc_context
from matplotlib.colors import to_rgba
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes import series
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.figures.compare import compare_figure
from icub_jump_env.evaluation.modes.compare import render
from icub_jump_env.evaluation.statistics.summary import Rate
from icub_jump_env.metrics.jump import SuccessConfig


def two_ranges(pattern, rise):
    """Four episodes at 4 cm, then four at 6 cm."""
    return [
        episode(
            seed, None if char == "1" else Failure.SLIPPED, jump_height=0.04 if seed < 4 else 0.06,
            flight_height=rise, sole_height=rise - 0.003, flight_rotation=0.1, landing_force=1000.0, joint_work=100.0,
        )
        for seed, char in enumerate(pattern)
    ]  # fmt: skip


ARMS = {"first": two_ranges("11101100", 0.04), "second": two_ranges("11111110", 0.05)}


def printed(table):
    console = Console(file=io.StringIO(), width=200)
    console.print(table)
    return [line.split("  ") for line in console.file.getvalue().splitlines()]


class TestTable:
    def test_a_row_for_each_command_and_contender_and_for_all(self):
        rows = [[cell.strip() for cell in row if cell.strip()] for row in printed(render(ARMS))]
        for expected in (
            ["4 to 5 cm", "first", "75.0 %", "30.1 to 95.4", "75.0 %"],
            ["second", "100.0 %", "51.0 to 100.0", "100.0 %"],
            ["6 to 7 cm", "first", "50.0 %", "15.0 to 85.0"],
            ["second", "75.0 %", "30.1 to 95.4"],
            ["all", "first", "62.5 %", "30.6 to 86.3"],
            ["second", "87.5 %", "52.9 to 97.8"],
        ):
            assert any(row[: len(expected)] == expected for row in rows), expected
        assert rows[1][:2] == ["command", "policy"]
        (last,) = [row for row in rows if row[:2] == ["second", "87.5 %"]]
        assert last[4:] == ["5.00", "4.70", "1.00", "5.7", "1000", "100"]

    def test_what_does_not_exist_is_a_dash(self):
        rows = printed(render({"idle": [episode(0, Failure.NO_TAKEOFF)]}))
        (row,) = [[cell for cell in map(str.strip, r) if cell] for r in rows if "idle" in str(r)]
        # Soles, distance from the command, rotation, landing force; no work was measured here.
        assert row[-5:] == ["0.00", "4.00", "-", "-", "0"]

    def test_one_command_needs_no_row_for_all(self):
        text = str(printed(render({name: arm[:4] for name, arm in ARMS.items()})))
        assert "4 cm" in text
        assert "all'" not in text

    def test_names_are_shown_as_they_are(self):
        text = printed(render({"mine[v2]": ARMS["first"], "mine[v3]": ARMS["second"]}))
        assert "mine[v2]" in str(text)
        assert "mine[v3]" in str(text)


class TestFigure:
    def test_bars_are_the_success_rates_with_their_intervals(self):
        figure = compare_figure(ARMS, SuccessConfig(height_ratio=0.6))
        left, _ = figure.axes
        assert [label.get_text() for label in left.get_xticklabels()] == ["4 to 5", "6 to 7"]
        assert (left.get_xlabel(), left.get_ylabel()) == ("command (cm)", "success (%)")
        (legend,) = figure.legends
        shown = [text.get_text() for text in legend.get_texts()]
        assert shown == ["first", "second", "95 % interval"]
        bars = {c.get_label(): c for c in left.containers if hasattr(c, "patches")}
        for name, counts in (("first", (3, 2)), ("second", (4, 3))):
            assert [bar.get_height() for bar in bars[name]] == [25.0 * n for n in counts]
            (stems,) = bars[name].errorbar.lines[2]
            ends = [segment[:, 1] for segment in stems.get_segments()]
            intervals = [100 * np.array(Rate(n, 4).interval) for n in counts]
            np.testing.assert_allclose(ends, intervals, atol=1e-9)
        first, second = (bars[name].patches[0] for name in ("first", "second"))
        assert first.get_x() + first.get_width() <= second.get_x()
        assert first.get_facecolor() != second.get_facecolor()

    def test_points_are_the_episodes(self):
        left, right = compare_figure(ARMS, SuccessConfig(height_ratio=0.6)).axes
        assert (right.get_xlabel(), right.get_ylabel()) == ("command (cm)", "CoM rise (cm)")
        *points, command, least = right.lines
        bars = [c for c in left.containers if hasattr(c, "patches")]
        for number, (arm, bar) in enumerate(zip(ARMS.values(), bars, strict=True)):
            landed, fallen = points[2 * number : 2 * number + 2]
            for line, stood in ((landed, True), (fallen, False)):
                shown = [e for e in arm if e.is_success == stood]
                assert list(line.get_xdata()) == [100 * e.jump_height for e in shown]
                assert list(line.get_ydata()) == [100 * e.jump["flight_height"] for e in shown]
                assert to_rgba(line.get_color()) == bar.patches[0].get_facecolor()
            assert landed.get_marker() != fallen.get_marker()
        assert list(command.get_ydata()) == pytest.approx([4.0, 6.0])
        assert list(least.get_ydata()) == pytest.approx([2.4, 3.6])
        shown = [text.get_text() for text in right.get_legend().get_texts()]
        assert shown == ["landed", "fallen", "command", "least for a success"]

    def test_names_are_shown_as_they_are(self, tmp_path):
        names = ["cost$1$", r"\$2", "_hidden", "a_b^c"]
        figure = compare_figure(dict.fromkeys(names, ARMS["first"]), SuccessConfig())
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()][:-1] == names
        with rc_context({"svg.fonttype": "none"}):
            figure.savefig(tmp_path / "figure.svg")
        drawn = re.findall("<text [^>]*>(.*?)</text>", (tmp_path / "figure.svg").read_text())
        assert set(names) <= set(drawn)


RANDOM = {"randomization": "full", "jump_height": (0.03, 0.06), "stand_time": 0.0}
FLAGS = ("--randomization", "full", "--jump-height", "0.03", "0.06", "--stand-time", "0")


@pytest.fixture
def files(tmp_path):
    """A policy that does nothing, and one that does something."""
    return (
        save_constant(tmp_path / "idle.safetensors", 0, 0, 0),
        save(tmp_path / "busy.safetensors", FEEDBACK),
    )


@pytest.fixture
def asked(files):
    return ["--compare", "baseline", *files, *FLAGS, "--episodes", "3", "--seed", "5"]


def logs():
    """Header and episodes of each contender, by its name."""
    contents = {}
    for path in Path("results").glob("*.jsonl"):
        header, *episodes = map(json.loads, path.read_text().splitlines())
        contents[header["policy"]["name"]] = header, episodes
    return contents


class TestCommand:
    def test_all_meet_the_same_worlds_and_commands(self, capsys, asked):
        code, *_ = evaluate(capsys, *asked)
        assert code == 0
        found = {name: episodes for name, (_, episodes) in logs().items()}
        assert sorted(found) == ["baseline", "busy", "idle"]
        for name in ("idle", "busy"):
            for entry in ("seed", "world", "jump_height"):
                assert [e[entry] for e in found[name]] == [e[entry] for e in found["baseline"]]
        baseline = found["baseline"]
        assert [e["seed"] for e in baseline] == [5, 6, 7]
        assert len({e["jump_height"] for e in baseline}) == 3
        assert len({e["world"]["friction"] for e in baseline}) == 3
        assert found["idle"] == baseline
        env = make_env(JumpConfig.of(**RANDOM))
        for policy, name in (((), "baseline"), ((FEEDBACK,), "busy")):
            expected = [run_episode(env, seed, *policy) for seed in (5, 6, 7)]
            assert [e["jump"]["flight_height"] for e in found[name]] == [
                e.jump["flight_height"] for e in expected
            ]

    def test_says_writes_and_draws_what_was_found(self, capsys, asked):
        code, out, err = evaluate(capsys, *asked, "--json", "r.json", "--plot", "figures")
        assert code == 0
        assert Path("figures/compare.png").stat().st_size > 10_000
        for output in ("r.json", "figures/compare.png"):
            assert f"wrote {output}" in err
        content = json.loads(Path("r.json").read_text(), parse_constant=pytest.fail)
        assert (content["mode"], content["episodes"], content["seed"]) == ("compare", 3, 5)
        assert content["config"]["jump_height"] == [0.03, 0.06]
        assert list(content["contenders"]) == ["baseline", "idle", "busy"]
        found = {name: episodes for name, (_, episodes) in logs().items()}
        for name, contender in content["contenders"].items():
            rises = [e["jump"]["flight_height"] for e in found[name]]
            assert contender["all"]["mean_rise"] == pytest.approx(np.mean(rises))
            assert contender["all"]["success"]["total"] == 3
            assert contender["name"] == name
            for group in contender["by_command"]:
                low, high = group["jump_height"]
                inside = [e for e in found[name] if low <= e["jump_height"] < high]
                assert group["landed"]["total"] == len(inside) > 0
        assert [content["contenders"][n]["sha256"] is None for n in content["contenders"]] == [
            True, False, False,
        ]  # fmt: skip
        pairs = {(pair["ours"], pair["theirs"]): pair for pair in content["differences"]}
        assert list(pairs) == [("idle", "baseline"), ("busy", "baseline"), ("busy", "idle")]
        assert pairs["busy", "idle"]["all"] == pairs["busy", "baseline"]["all"]
        differences = {pair["ours"]: pair["all"] for pair in content["differences"][:2]}
        for pair in content["differences"]:
            groups = pair["by_command"]
            counted = sum(group["won"] - group["lost"] for group in groups)
            assert counted == pair["all"]["won"] - pair["all"]["lost"]
            assert [group["jump_height"] for group in groups] == [
                group["jump_height"] for group in content["contenders"]["busy"]["by_command"]
            ]
        assert differences["idle"]["p_value"] == 1.0
        assert differences["idle"]["rise_interval"] == [0.0, 0.0]
        gains = [
            ours["jump"]["flight_height"] - theirs["jump"]["flight_height"]
            for ours, theirs in zip(found["busy"], found["baseline"], strict=True)
        ]
        assert differences["busy"]["rise"] == pytest.approx(np.mean(gains))

        assert out.startswith(
            "3 to 6 cm jump, velocity controller, randomization full, seeds 5 to 7"
        )
        assert (
            "idle against baseline: success +0.0 points (95 % interval -39.2 to +39.2; won 0, "
            "lost 0, McNemar p = 1.000, corrected p = 1.000), rise +0.00 cm (+0.00 to +0.00), "
            "soles +0.00 cm (+0.00 to +0.00)\n" in out
        )
        for name in ("baseline", "idle", "busy"):
            failed = [e["failure"] for e in found[name] if e["failure"]]
            counts = [f"{failed.count(kind)} {kind}" for kind in sorted(set(failed))]
            (line,) = [line for line in out.splitlines() if line.startswith(f"{name} failed: ")]
            assert sorted(line.split(": ")[1].split(", ")) == (sorted(counts) or ["never"])
        line = next(line for line in out.splitlines() if line.startswith("busy against baseline"))
        assert f"rise {100 * np.mean(gains):+.2f} cm" in line
        assert not [line for line in out.splitlines() if line.startswith("baseline against")]

    def test_p_values_are_corrected_for_the_number_of_comparisons(self, capsys, asked):
        _, out, _ = evaluate(capsys, *asked, "--json", "r.json")
        assert out.endswith("\ncorrected p: Holm-corrected over 3 comparisons\n")
        differences = json.loads(Path("r.json").read_text())["differences"]
        assert all(pair["all"]["corrected_p_value"] is not None for pair in differences)

    def test_a_single_comparison_needs_no_correction(self, capsys, files):
        _, out, _ = evaluate(capsys, "--compare", "baseline", files[1], *FLAGS, "--episodes", "2")
        assert "McNemar p" in out
        assert "corrected" not in out

    def test_the_first_one_is_what_the_others_are_compared_with(self, capsys, files):
        _, out, _ = evaluate(capsys, "--compare", files[1], "baseline", *FLAGS, "--episodes", "2")
        assert "baseline against busy: " in out

    def test_resume_takes_what_the_logs_have(self, capsys, asked, monkeypatch):
        _, expected, _ = evaluate(capsys, *asked)
        names = sorted(path.name for path in Path("results").iterdir())
        whole = {name: (Path("results") / name).read_bytes() for name in names}
        (busy,) = [name for name in names if "busy" in name]
        lines = whole[busy].splitlines(keepends=True)
        (Path("results") / busy).write_bytes(b"".join(lines[:2]))
        run_jobs, ran = series.run_jobs, []

        def watched(work, jobs):
            ran.extend((job.seed, job.policy) for job in work)
            return run_jobs(work, jobs)

        monkeypatch.setattr(series, "run_jobs", watched)
        code, out, _ = evaluate(capsys, *asked, "--resume")
        assert (code, out) == (0, expected)
        assert [seed for seed, _ in ran] == [6, 7]
        assert {policy.card.inputs for _, policy in ran} == {FEEDBACK.inputs}
        assert {path.name: path.read_bytes() for path in Path("results").iterdir()} == whole

        # Logs that are not there at all, as of a contender that is new, are begun.
        (Path("results") / busy).unlink()
        assert evaluate(capsys, *asked, "--resume")[1] == expected
        assert [seed for seed, _ in ran[2:]] == [5, 6, 7]

    def test_without_resume_earlier_logs_are_kept_and_all_is_run_again(self, capsys, asked):
        _, expected, _ = evaluate(capsys, *asked)
        code, out, err = evaluate(capsys, *asked)
        assert (code, out) == (0, expected)
        assert err.count("kept the earlier episodes") == 3
        assert len(list(Path("results").iterdir())) == 6

    def test_the_commands_of_the_training_are_the_default(self, capsys, tmp_path):
        file = save(
            tmp_path / "p.safetensors", FEEDBACK, jump_height=(0.03, 0.04), com_displacement=0.1
        )
        common = ["--compare", "baseline", file, "--stand-time", "0", "--episodes", "2"]
        code, out, _ = evaluate(capsys, *common)
        assert code == 0
        assert out.startswith("3 to 4 cm jump")
        for header, episodes in logs().values():
            assert header["config"]["com_displacement"] == 0.1
            assert all(0.03 <= e["jump_height"] <= 0.04 for e in episodes)
        assert evaluate(capsys, *common, "--jump-height", "0.05")[1].startswith("5 cm jump")

    def test_policies_of_different_environments_are_refused(self, capsys, tmp_path, files):
        other = save(tmp_path / "other.safetensors", FEEDBACK, com_displacement=0.1)
        code, out, err = evaluate(capsys, "--compare", *files, other, "--episodes", "2")
        assert (code, out) == (2, "")
        assert err.startswith("error: other: ")
        assert err.count("\n") == 1
        assert "com_displacement=None instead of 0.1" in err

    @pytest.mark.parametrize("drawn", [True, False])
    def test_a_range_of_commands_needs_a_number_of_episodes(
        self, capsys, monkeypatch, tmp_path, drawn
    ):
        """Also where the card of a policy brings it."""
        monkeypatch.setattr(series.Series, "run", lambda *_: pytest.fail("should not jump"))
        card = {} if drawn else {"jump_height": (0.03, 0.04)}
        flags = ["--jump-height", "0.03", "0.04"] if drawn else []
        file = save(tmp_path / "p.safetensors", FEEDBACK, **card)
        code, _, err = evaluate(capsys, "--compare", "baseline", file, *flags)
        assert code == 2
        assert "episodes=None is not allowed: " in err
        assert "3 to 4 cm" in err

    def test_a_single_episode_is_compared_without_intervals(self, capsys, files):
        flags = ("--randomization", "full", "--jump-height", "0.04", "--stand-time", "0")
        code, out, _ = evaluate(capsys, "--compare", "baseline", files[1], *flags)
        assert code == 0
        assert "seed 0 for each" in out
        assert "interval " not in out.partition("busy against baseline")[2]
