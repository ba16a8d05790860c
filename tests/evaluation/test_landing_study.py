"""The landing study: its cases, its pairs, and what it writes."""

import dataclasses
import io
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from contenders import episode, evaluate, outcomes
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes import series
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.figures.landing import landing_figure
from icub_jump_env.evaluation.modes import landing_study
from icub_jump_env.evaluation.modes.landing_cases import (
    VARIANTS,
    disturbances_of,
    landing_cases,
)
from icub_jump_env.evaluation.modes.landing_study import LandingResult, render
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.simulation.randomization import RANDOMIZATIONS, Randomization

CONTROLLERS = ("velocity", "torque")
CONFIGS = {name: JumpConfig.of(controller=name) for name in CONTROLLERS}
FEW = landing_cases(JumpConfig())
PLAIN, SPUN = FEW[0], next(case for case in FEW if case.group == "rotation at lift-off")
STANDING = {
    "hold": "1" * 10 + "0" * 10,
    "flight feedback": "0" * 20,
    "landing feedback": "0" * 1 + "1" * 10 + "0" * 9,
    "feedback": "1" * 20,
}
FORCES = {"hold": 1234.0, "feedback": 987.0}


def made_up(case):
    return LandingResult.of(
        case,
        {
            variant: outcomes(pattern, landing_force=FORCES.get(variant, 1.0))
            for variant, pattern in STANDING.items()
        },
    )


def lines_of(table):
    console = Console(file=io.StringIO(), width=250)
    console.print(table)
    return [line.strip() for line in console.file.getvalue().splitlines()]


class TestCases:
    @pytest.mark.parametrize("controller", CONTROLLERS)
    def test_every_case_is_a_valid_jump_of_each_variant(self, controller):
        config = CONFIGS[controller]
        jumps = [
            config.replace(**case.changes, **changes)
            for case in landing_cases(config)
            for changes in VARIANTS.values()
        ]
        assert len(set(jumps)) == len(jumps) == 4 * 44
        assert {jump.controller_name for jump in jumps} == {controller}
        assert all(jump.randomization_config.varies for jump in jumps)

    def test_controllers_differ_in_the_highest_plan_alone(self):
        velocity, torque = (landing_cases(config) for config in CONFIGS.values())
        differing = [(v, t) for v, t in zip(velocity, torque, strict=True) if v != t]
        ((ours, theirs),) = differing
        assert ours.label == theirs.label == "highest plan, full"
        assert (ours.changes["jump_height"], theirs.changes["jump_height"]) == (0.078, 0.0725)

    def test_a_disturbance_has_one_size_in_the_worlds_full(self):
        mass = FeetFixedKinematics(JumpConfig().robot_value).mass
        units = {
            "takeoff_spin": math.radians(1.0) / 0.19, "floor_tilt": math.radians(1.0),
            "floor_tilt_lateral": math.radians(1.0), "step": 0.01, "edge": 0.01,
            "flight_push": mass, "landing_push": mass, "lateral_slope": math.radians(1.0),
            "push": 1.0,
        }  # fmt: skip
        seen = set()
        for case in landing_cases(JumpConfig()):
            if case.size is None:
                continue
            ranges, full = case.changes["randomization"], RANDOMIZATIONS["full"]
            assert case.changes["jump_height"] == 0.04
            changed = {
                field.name: getattr(ranges, field.name)
                for field in dataclasses.fields(Randomization)
                if getattr(ranges, field.name) != getattr(full, field.name)
            }
            direction = changed.pop("landing_push_direction", (0.0, 0.0))
            sideways = case.group == "side push after landing"
            assert direction == ((math.pi / 2,) * 2 if sideways else (0.0, 0.0))
            ((name, (low, high)),) = changed.items()
            assert low == high == pytest.approx(case.size * units[name])
            seen.add(name)
        assert seen == units.keys()

    def test_sizes_ascend_and_zero_is_the_case_without_any(self):
        for disturbance in disturbances_of(JumpConfig()):
            assert list(disturbance.sizes) == sorted(disturbance.sizes)
            assert 0.0 not in disturbance.sizes
        first = FEW[0]
        assert (first.size, first.group) == (None, "")
        assert first.changes == {"jump_height": 0.04, "randomization": "full"}

    @pytest.mark.parametrize(
        "field", sorted({f for case in FEW for f in case.changes} | set(VARIANTS["hold"]))
    )
    def test_what_varies_cannot_be_chosen(self, field):
        other = {
            "jump_height": 0.05, "com_displacement": 0.1, "planner": "whole_body",
            "randomization": "hard", "sensors": "realistic", "estimator": "imu",
            "flight": "feedback", "landing": "feedback",
        }  # fmt: skip
        changes = {field: other[field]}
        if field in ("flight", "landing"):  # which need the other, and it is refused first
            changes["estimator"] = "imu"
        with pytest.raises(ConfigError, match="not with --study landing, which") as refusal:
            EvalOptions(JumpConfig.of(**changes), study="landing")
        assert refusal.value.field in changes


class TestResult:
    def test_pairs_are_counted_against_hold(self):
        found = made_up(PLAIN).against_hold
        assert {name: (d.won, d.lost, d.pairs) for name, d in found.items()} == {
            "flight feedback": (0, 10, 20), "landing feedback": (1, 1, 20),
            "feedback": (10, 0, 20),
        }  # fmt: skip
        assert found["feedback"].p_value == pytest.approx(2 / 2**10)

    def test_signs(self):
        result = made_up(PLAIN)
        assert [result.sign(variant) for variant in VARIANTS] == [0, -1, 0, 1]

    def test_standing_counts_not_success(self):
        """A robot that jumped too low stands all the same."""
        low = {variant: outcomes("0" * 4, landed=True) for variant in VARIANTS}
        result = LandingResult.of(PLAIN, low)
        assert result.summaries["hold"].landed.count == 4
        assert result.against_hold["feedback"].gain == 0.0


class TestTable:
    def test_a_row_for_each_case(self):
        results = {name: [made_up(PLAIN), made_up(SPUN)] for name in CONTROLLERS}
        lines = lines_of(render("torque", results, EvalOptions(study="landing", episodes=20)))
        assert lines[0].startswith("Standing rate, torque controller, seeds 0 to 19")
        (row,) = [line for line in lines if line.startswith("4 cm, full")]
        cells = [cell.strip() for cell in row.split("  ") if cell.strip()]
        assert cells == [
            "4 cm, full", "50 (30-70)", "0 (0-16) <", "50 (30-70)", "100 >", "1234", "987",
        ]  # fmt: skip
        assert any(
            line.startswith("rotation at lift-off, deg in 0.19 s, + forw") for line in lines
        )
        assert any(line.startswith("-10 ") for line in lines)
        assert "of the 12 comparisons of both" in " ".join(lines)


class TestFigure:
    def test_zero_is_the_case_without_disturbance(self):
        disturbances = disturbances_of(JumpConfig())
        cases = landing_cases(JumpConfig())
        results = {name: [made_up(case) for case in cases] for name in CONTROLLERS}
        figure = landing_figure(results, disturbances)
        axes = {axis.get_title(): axis for axis in figure.axes}
        assert axes.keys() == {"without disturbance", *(d.name for d in disturbances)}
        assert len(figure.axes) == 2 * len(axes)
        tilt = axes["floor tilt sideways"]
        assert list(tilt.get_xticks()) == [0, 2, 4, 6]
        assert tilt.get_xlabel() == "deg, uphill to the left"
        hold, flight, *_ = [line for line in tilt.lines if len(line.get_xdata()) > 1]
        np.testing.assert_allclose(hold.get_ydata(), 50.0)
        np.testing.assert_allclose(flight.get_ydata(), 0.0)
        assert hold.get_color() != flight.get_color()

    def test_filled_is_what_differs_significantly(self):
        cases = landing_cases(JumpConfig())
        results = {"torque": [made_up(case) for case in cases]}
        figure = landing_figure(results, disturbances_of(JumpConfig()))
        points = [line for line in figure.axes[1].lines if len(line.get_xdata()) == 1]
        faces = [line.get_markerfacecolor() for line in points]
        sizes = len(points) // 4
        filled = [faces[n * sizes] != "white" for n in range(4)]
        assert filled == [True, True, False, True]
        (legend,) = figure.legends
        shown = {text.get_text() for text in legend.get_texts()}
        assert {*VARIANTS, "95 % interval, 20 episodes"} <= shown


@pytest.fixture
def two_cases(monkeypatch, tmp_path):
    """The study shrinks to two cases, which nobody jumps; the series that it asks for."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(landing_study, "landing_cases", lambda config: [PLAIN, SPUN])
    asked = []

    def run_jobs(work, jobs):
        asked.append([(job.config, job.seed) for job in work])
        for index, job in enumerate(work):
            stands = job.config.landing == "feedback"
            failure = None if stands else Failure.FELL_FORWARD
            yield index, episode(job.seed, failure, landing_force=100.0 * job.seed)

    monkeypatch.setattr(series, "run_jobs", run_jobs)
    return asked


class TestRun:
    arguments = ("--study", "landing", "--episodes", "4", "--seed", "3", "--stand-time", "0.1")

    def test_every_variant_jumps_the_same_seeds(self, capsys, two_cases):
        evaluate(capsys, *self.arguments)
        (asked,) = two_cases
        expected = [
            JumpConfig.of(controller=controller, stand_time=0.1, **case.changes, **changes)
            for controller in CONTROLLERS
            for case in (PLAIN, SPUN)
            for changes in VARIANTS.values()
        ]
        assert asked == [(config, seed) for config in expected for seed in range(3, 7)]

    def test_writes_everything(self, capsys, two_cases):
        code, out, _ = evaluate(capsys, *self.arguments, "--json", "s.json", "--plot", "figures")
        assert code == 0
        assert Path("figures/landing.png").stat().st_size > 50_000
        for controller in CONTROLLERS:
            assert f"Standing rate, {controller} controller, seeds 3 to 6" in out
        found = json.loads(Path("s.json").read_text())
        assert found["variants"] == {name: dict(changes) for name, changes in VARIANTS.items()}
        assert found["units"]["push in the launch"] == "N s, + forward"
        assert found["episodes"] == 4
        assert found["cases"].keys() == set(CONTROLLERS)
        plain, spun = found["cases"]["torque"]
        assert (plain["group"], plain["label"], plain["size"]) == ("", "4 cm, full", None)
        assert (spun["group"], spun["label"], spun["size"]) == ("rotation at lift-off", "-10", -10)
        spin = math.radians(-10) / 0.19
        assert spun["changes"]["randomization"]["takeoff_spin"] == pytest.approx([spin, spin])
        hold, feedback = (spun["variants"][variant] for variant in ("hold", "feedback"))
        assert hold["against_hold"] is None
        assert (hold["landed"]["count"], feedback["landed"]["count"]) == (0, 4)
        assert hold["failures"] == {"fell forward": [3, 4, 5, 6]}
        assert hold["percentiles"]["landing_force"][1] == pytest.approx(450.0)
        against = feedback["against_hold"]
        assert (against["won"], against["lost"], against["pairs"]) == (4, 0, 4)
        assert against["p_value"] == pytest.approx(0.125)
        assert against["corrected_p_value"] == 1.0

    def test_interrupted_and_resumed_equals_uninterrupted(self, capsys, monkeypatch, two_cases):
        _, expected, _ = evaluate(capsys, *self.arguments)
        made_up_jobs = series.run_jobs

        def interrupted(work, jobs):
            yield from itertools.islice(made_up_jobs(work, jobs), 5)
            raise KeyboardInterrupt

        monkeypatch.setattr(series, "run_jobs", interrupted)
        code, out, err = evaluate(capsys, *self.arguments)
        assert (code, out) == (130, "")
        assert "kept the earlier episodes in 16 logs beside the new ones" in err
        assert "5 of 64 episodes are in 16 logs in results; add --resume" in err
        monkeypatch.setattr(series, "run_jobs", made_up_jobs)
        for _ in range(2):
            _, out, _ = evaluate(capsys, *self.arguments, "--resume")
            assert out == expected
        assert [len(work) for work in two_cases[-2:]] == [59, 0]


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_jumps(controller, variant):
    config = CONFIGS[controller].replace(**PLAIN.changes, **VARIANTS[variant], stand_time=0.05)
    assert run_episode(make_env(config), 0).jump["landing_force"] > 0.0
