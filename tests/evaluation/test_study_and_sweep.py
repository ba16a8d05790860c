"""The studies and the sweep: every case and cell is the jump that its label says."""

import dataclasses
import io
import json
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import jump
from contenders import episode
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.episodes.series import perturbed, varies
from icub_jump_env.evaluation.figures.sweep import sweep_figure
from icub_jump_env.evaluation.modes import cases, study, sweep
from icub_jump_env.evaluation.modes.study import STUDIES, CaseResult
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.robot.urdf import model_names
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl, TorqueFeedback
from icub_jump_env.simulation.sensor_models import SENSORS

SHORT = JumpConfig.of(stand_time=0.1)


def consoles():
    return Console(file=io.StringIO(), width=100), Console(file=io.StringIO())


def case(label, group=None):
    (found,) = [
        c for c in cases.realism() if c.label == label and (group is None or c.group == group)
    ]
    return found


@pytest.mark.parametrize("name", ["realism", "constraints", "launch_end", "robots"])
def test_what_is_below_the_table_is_of_its_columns(name):
    asked = STUDIES[name]
    caption = study.render(asked, [], EvalOptions(SHORT, study=name)).caption
    assert ("control ticks without a solution" in caption) == ("unsolved" in asked.columns)
    assert ("rotation" in caption) == ("rot." in asked.columns)
    assert ("soles" in caption) == ("soles" in asked.columns)
    for heading in ("landed", "success"):
        assert (heading in caption.split("episodes;")[1]) == (heading in asked.columns)


class TestRealism:
    def test_delays_of_0_to_3_ticks(self):
        delays = [c.changes for c in cases.realism() if c.group == "computation time"]
        assert delays == [{"command_delay": ticks} for ticks in range(4)]

    def test_labels_say_what_is_changed(self):
        loop = case("feedback, 5 Hz").changes["actuators"].torque_loop
        assert loop == TorqueFeedback(bandwidth=5.0)
        sensors = case("offset 40 N").changes["sensors"]
        assert (sensors.force.bias, sensors.moment.bias) == (40.0, 2.0)
        sensors = case("drift 80 N/s").changes["sensors"]
        assert (sensors.force.drift, sensors.force.bias) == (80.0, 0.0)
        assert case("calibration 20%").changes["sensors"].force_gain == 0.2
        both = case("current control, 2 ticks").changes
        assert both["sensors"] == "realistic"
        assert both["command_delay"] == 2
        assert isinstance(both["actuators"].torque_loop, CurrentControl)

    def test_offsets_go_with_moments_as_in_the_realistic_sensors(self):
        realistic = SENSORS["realistic"]
        sensors = case("offset 10 N").changes["sensors"]
        assert sensors.moment.bias / sensors.force.bias == pytest.approx(
            realistic.moment.bias / realistic.force.bias
        )

    def test_runs_each_case_with_both_controllers_and_writes_everything(
        self, monkeypatch, tmp_path
    ):
        chosen = [case("delay of 2 control ticks"), case("offset 80 N")]
        realism = dataclasses.replace(STUDIES["realism"], cases=lambda: chosen)
        monkeypatch.setitem(STUDIES, "realism", realism)
        console, progress = consoles()
        options = EvalOptions(
            SHORT, study="realism", episodes=2, seed=5, json=tmp_path / "s.json", plot=tmp_path
        )
        study.run(options, (), console, progress)
        assert (tmp_path / "realism.png").stat().st_size > 10_000
        late, offset = json.loads((tmp_path / "s.json").read_text())["cases"]
        for controller in ("velocity", "torque"):
            # Nothing is random there but the perturbation.
            config = JumpConfig.of(controller=controller, command_delay=2, stand_time=0.1)
            env = make_env(perturbed(config))
            rises = [run_episode(env, seed).jump["flight_height"] for seed in (5, 6)]
            low, middle, high = late[controller]["percentiles"]["flight_height"]
            assert [low, middle, high] == pytest.approx(np.percentile(rises, [10, 50, 90]))
            assert low < high < low + 0.002
            assert (
                late[controller]["landed"]["total"] == offset[controller]["landed"]["total"] == 2
            )
            assert f"{100 * middle:.2f}" in console.file.getvalue()
        low, _, high = offset["torque"]["percentiles"]["flight_height"]
        assert high > low
        low, _, high = offset["velocity"]["percentiles"]["flight_height"]
        assert high == low


@pytest.fixture
def asked(monkeypatch):
    """The episodes that studies ask for; none of them is run."""
    work = []

    def run_all(jobs, count, progress):
        work.extend(jobs)
        return [episode(job.seed, flight_height=0.0312, sole_height=0.0123) for job in jobs]

    monkeypatch.setattr(study, "run_all", run_all)
    return work


def posed(name, asked, **options):
    """Case, controller and configuration of each series of episodes of a study, and its table."""
    console, progress = consoles()
    study.run(EvalOptions(SHORT, study=name, episodes=2, **options), (), console, progress)
    assert [job.seed for job in asked] == [0, 1] * (len(asked) // 2)
    owners = [(c, name) for c in STUDIES[name].cases() for name in ("velocity", "torque")]
    assert [job.config for job in asked[::2]] == [job.config for job in asked[1::2]]
    found = [(*owner, job.config) for owner, job in zip(owners, asked[::2], strict=True)]
    return found, console.file.getvalue()


class TestAllStudies:
    @pytest.mark.parametrize("name", STUDIES)
    def test_every_case_is_its_change_of_both_controllers_jumps(self, asked, name):
        found, table = posed(name, asked)
        for asked_for, controller, config in found:
            expected = SHORT.replace(controller=controller).replace(**asked_for.changes)
            drawn = expected if varies(expected) else perturbed(expected)
            assert config == drawn
            assert varies(config)
            assert asked_for.label in table

    @pytest.mark.parametrize("height", ["4", "6"])
    @pytest.mark.parametrize(
        ("world", "randomization"), [("nominal", None), ("full", "full"), ("hard", "hard")]
    )
    def test_the_task_is_posed_hard_and_soft(self, asked, height, world, randomization):
        found, table = posed("constraints", asked)
        group = f"{height} cm, {world} world"
        assert group in table
        forms = [
            (label.label, controller, config)
            for label, controller, config in found
            if label.group == group
        ]
        assert [(form, controller) for form, controller, _ in forms] == [
            (form, controller)
            for form in ("soft", "hard")
            for controller in ("velocity", "torque")
        ]
        for form, controller, config in forms:
            assert config.controller_config.constraints == form
            assert config.controller_name == controller
            assert config.jump_height == pytest.approx(float(height) / 100)
            if randomization is not None:
                assert config.randomization == randomization
            else:
                assert config == perturbed(config)

    def test_the_launch_ends_as_the_label_says(self, asked):
        found, _ = posed("launch_end", asked)
        assert [(c.label, config.value_of("launch_end")) for c, _, config in found] == [
            ("at T or lift-off", "time"), ("at T or lift-off", "time"),
            ("at lift-off alone", "lift_off"), ("at lift-off alone", "lift_off"),
        ]  # fmt: skip

    def test_every_robot_jumps_beside_the_papers_numbers(self, asked):
        found, table = posed("robots", asked)
        assert [c.label for c, *_ in found[::2]] == model_names()
        assert all(config.robot == c.label for c, _, config in found)
        lines = [line.split() for line in table.splitlines()]
        (paper,) = [line for line in lines if line[:1] == ["the"]]
        assert paper == ["the", "paper's", "simulation", "3.5", "3.7", "1.6", "2.3"]
        row = next(line for line in lines if line[:1] == ["iCubGenova04"])
        assert row[1:] == ["3.12", "3.12", "to", "3.12", "1.23", "100"] * 2

    @pytest.mark.parametrize(
        ("name", "changes"),
        [
            ("realism", {"command_delay": 1}),
            ("constraints", {"constraints": "hard"}),
            ("constraints", {"jump_height": 0.05}),
            ("constraints", {"randomization": "mild"}),
            ("launch_end", {"launch_end": "lift_off"}),
            ("robots", {"robot": "iCubGazeboV2_5"}),
        ],
    )
    def test_what_a_study_varies_cannot_be_chosen(self, asked, name, changes):
        options = EvalOptions(JumpConfig.of(**changes), study=name)
        ((field, _),) = changes.items()
        with pytest.raises(
            ConfigError, match=f"not with --study {name}, which varies it"
        ) as refusal:
            study.run_cases(STUDIES[name], options, Console(quiet=True))
        assert refusal.value.field == field
        assert not asked

    def test_what_it_does_not_vary_can(self, asked):
        options = EvalOptions(JumpConfig.of(constraints="hard"), study="launch_end", episodes=1)
        study.run_cases(STUDIES["launch_end"], options, Console(quiet=True))
        assert {job.config.value_of("constraints") for job in asked} == {"hard"}

    def test_cases_without_a_real_flight_are_named(self):
        flew, stayed = episode(0), episode(1, Failure.NO_TAKEOFF)
        results = [
            CaseResult(
                cases.Case("", label, {}),
                {name: Summary.of(done) for name, done in by_controller.items()},
            )
            for label, by_controller in {
                "one": {"velocity": [flew, flew], "torque": [flew, stayed]},
                "other": {"velocity": [stayed, stayed], "torque": [episode(0, Failure.SLIPPED)]},
            }.items()
        ]
        assert study.short_flights(results, 0.1) == [
            "torque, one: no flight of 0.1 s in 1 of 2",
            "velocity, other: no flight of 0.1 s in 2 of 2",
        ]


class TestSweep:
    def test_the_grid(self):
        assert pytest.approx(sweep.HEIGHTS) == [0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08]
        assert pytest.approx(sweep.DISPLACEMENTS) == [0.08, 0.09, 0.10, 0.11, 0.12, 0.13, 0.14]

    def test_every_cell_is_its_own_jump(self, monkeypatch, tmp_path):
        monkeypatch.setattr(sweep, "HEIGHTS", (0.03, 0.05))
        monkeypatch.setattr(sweep, "DISPLACEMENTS", (0.09, 0.12))
        console, progress = consoles()
        options = EvalOptions(SHORT, sweep=True, json=tmp_path / "s.json", plot=tmp_path)
        sweep.run(options, (), console, progress)
        assert (tmp_path / "sweep.png").stat().st_size > 10_000
        cells = json.loads((tmp_path / "s.json").read_text())["cells"]
        assert len(cells) == 8
        for cell in cells:
            names = ("controller", "jump_height", "com_displacement")
            config = {name: cell[name] for name in names}
            expected = jump(**config, stand_time=0.1)
            assert cell["jump"]["flight_height"] == expected.jump["flight_height"]
            assert f"{100 * expected.jump['flight_height']:.2f}" in console.file.getvalue()

    def test_falls_are_in_brackets(self, monkeypatch):
        monkeypatch.setattr(sweep, "HEIGHTS", (0.04,))
        monkeypatch.setattr(sweep, "DISPLACEMENTS", (0.11,))
        console, progress = consoles()
        config = JumpConfig.of(momentum_control=False, stand_time=1.5)
        sweep.run(EvalOptions(config, sweep=True), (), console, progress)
        rise = 100 * jump(momentum_control=False, stand_time=1.5).jump["flight_height"]
        assert f"({rise:.2f})" in console.file.getvalue()

    def test_the_figure_says_the_same(self):
        found = {
            (controller, height, 0.1): SimpleNamespace(
                jump={"flight_height": height, "flight_rotation": turned, "landed": landed}
            )
            for controller in ("velocity", "torque")
            for height, turned, landed in ((0.02, -0.0001, True), (0.03, 0.1, False))
        }
        figure = sweep_figure(found)
        panels = [[text.get_text() for text in axis.texts] for axis in figure.axes[:4]]
        assert panels == [["2.0", "(3.0)"]] * 2 + [["0.0", "(5.7)"]] * 2
        assert figure.get_suptitle() == "in brackets: fell"
        stood = {cell: episode for cell, episode in found.items() if episode.jump["landed"]}
        assert sweep_figure(stood).get_suptitle() == "lands in every cell"
