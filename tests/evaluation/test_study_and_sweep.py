"""The realism study and the sweep: every case and cell is the jump that its label says."""

import io
import json

import pytest
from conftest import jump
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.modes import study, sweep
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl, TorqueFeedback
from icub_jump_env.simulation.sensor_models import SENSORS

SHORT = JumpConfig.of(stand_time=0.1)


def consoles():
    return Console(file=io.StringIO(), width=100), Console(file=io.StringIO())


def case(label, group=None):
    (found,) = [
        c for c in study.cases() if c.label == label and (group is None or c.group == group)
    ]
    return found


class TestStudy:
    def test_delays_of_0_to_3_ticks(self):
        delays = [c.changes for c in study.cases() if c.group == "computation time"]
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
        monkeypatch.setattr(study, "cases", lambda: chosen)
        console, progress = consoles()
        options = EvalOptions(
            SHORT, study="realism", episodes=2, seed=5, json=tmp_path / "s.json", plot=tmp_path
        )
        study.run(options, (), console, progress)
        assert (tmp_path / "realism.png").stat().st_size > 10_000
        late, offset = json.loads((tmp_path / "s.json").read_text())["cases"]
        for controller in ("velocity", "torque"):
            expected = jump(controller=controller, command_delay=2, stand_time=0.1)
            rise = expected.jump["flight_height"]
            assert late[controller]["percentiles"]["flight_height"] == [rise] * 3
            assert late[controller]["landed"]["total"] == 1  # nothing is random there
            assert offset[controller]["landed"]["total"] == 2
            assert f"{100 * rise:.2f}" in console.file.getvalue()
        low, _, high = offset["torque"]["percentiles"]["flight_height"]
        assert high > low
        low, _, high = offset["velocity"]["percentiles"]["flight_height"]
        assert high == low


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
