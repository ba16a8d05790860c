"""The command line: what it prints and writes, and how it refuses."""

import dataclasses
import json
import os
import pty
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from contenders import evaluate, save_constant

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ContactConfig, TorqueConfig
from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.figures import style
from icub_jump_env.evaluation.modes import video
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.report.output import write_json
from icub_jump_env.metrics.jump import SuccessConfig
from icub_jump_env.planning.residual import ResidualConfig
from icub_jump_env.shortcuts import Shortcuts

REPOSITORY = Path(__file__).parents[2]

ONE_EPISODE = ["--randomization", "full", "--stand-time", "0"]
"""A short work for another process."""


@pytest.fixture
def coarse(monkeypatch):
    """Pictures are drawn faster."""
    monkeypatch.setattr(style, "DPI", 50)


def test_prints_the_table_and_writes_json_and_figures(capsys, tmp_path, coarse):
    report, figures = tmp_path / "report.json", tmp_path / "figures"
    code, out, _ = evaluate(
        capsys, "--stand-time", "0.3", "--json", str(report), "--plot", str(figures)
    )
    assert code == 0
    for column in ("paper", "ours", "10 to 90 %", "difference", "no eq. 3d"):
        assert column in out
    for row in ("flight height", "sole height", "take-off velocity", "take-off time",
                "ballistic height", "rotation", "base pitch", "landed"):  # fmt: skip
        assert row in out
    # For 0.3 s it does.
    assert "The robot stands with the momentum constraint (3d) and without it." in out

    content = json.loads(report.read_text(), parse_constant=pytest.fail)
    assert content["config"]["success"]["stand_time"] == 0.3
    assert content["seed"] == 0
    assert {"mujoco", "pin", "daqp", "icub-models", "python"} <= set(content["versions"])
    rises = {
        name: 100 * np.array(arm["repeated"]["percentiles"]["flight_height"])
        for name, arm in content["arms"].items()
    }
    flight = next(r for r in content["comparison"] if r["quantity"].startswith("flight height"))
    assert [*flight["spread"], flight["ours"]] == pytest.approx(rises["with"][[0, 2, 1]])
    assert flight["other"] == pytest.approx(rises["without"][1])
    assert flight["spread"][0] < flight["ours"] < flight["spread"][1]
    assert flight["difference"] == pytest.approx(flight["ours"] - 3.5)
    pictures = sorted(figures.glob("*.png"))
    numbers = [p.name[:4] for p in pictures if p.name[:4] != "fig5"]  # which needs OpenGL
    assert numbers == ["fig1", "fig2", "fig4", "fig6"]
    assert all(p.stat().st_size > 5_000 for p in pictures)


def test_figures_are_drawn_of_a_jump_that_does_not_take_off(capsys, tmp_path, coarse):
    weak = '{"motor": {"kind": "dc", "current_limit": 0.3}}'
    code, _, err = evaluate(capsys, "--actuators", weak, "--plot", str(tmp_path / "figures"))
    assert code == 0
    assert "fig6_base_pitch.png" in err


def test_without_the_constraint_ours_is_the_ablated_jump(capsys):
    _, out, _ = evaluate(capsys, "--stand-time", "0.2")
    _, switched, _ = evaluate(capsys, "--stand-time", "0.2", "--momentum-control", "False")
    assert "no eq. 3d" in out
    assert "with eq. 3d" in switched
    row, other = (
        next(line.split() for line in text.splitlines() if "rotation" in line)
        for text in (out, switched)
    )
    assert row[:5] == other[:5] == ["rotation", "in", "flight,", "deg", "-"]
    assert (row[5], row[-1]) == (other[-1], other[5])
    assert row[5] != row[-1]


def test_missing_egl_does_not_matter_without_pictures(tmp_path):
    """MuJoCo cannot even be imported with MUJOCO_GL=egl and no libEGL."""
    (tmp_path / "sitecustomize.py").write_text(
        "import ctypes.util\n"
        "find = ctypes.util.find_library\n"
        "ctypes.util.find_library = lambda n: None if n in ('EGL', 'GL', 'OpenGL') else find(n)\n"
        "load = ctypes.CDLL.__init__\n"
        "def refuse(self, name, *a, **k):\n"
        "    if name and any(w in str(name) for w in ('libEGL', 'libGL', 'libOpenGL')):\n"
        "        raise OSError('not here')\n"
        "    load(self, name, *a, **k)\n"
        "ctypes.CDLL.__init__ = refuse\n"
    )
    environment = {
        **{k: v for k, v in os.environ.items() if k not in ("DISPLAY", "MUJOCO_GL")},
        "PYTHONPATH": f"{tmp_path}:{REPOSITORY}",
    }
    for arguments, code in ((ONE_EPISODE, 0), (["--video", "jump.mp4"], 2)):
        result = subprocess.run(
            [sys.executable, str(REPOSITORY / "eval.py"), *arguments],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert result.returncode == code, result.stderr
        if code:
            assert result.stderr.startswith("error: ")
            assert result.stderr.count("\n") == 1
            assert "libegl1" in result.stderr


def test_every_field_of_the_configuration_is_a_flag_of_the_same_name(capsys):
    _, out, _ = evaluate(capsys, "--help")
    assert ":class:" not in out
    for kind in (JumpConfig, Shortcuts):
        for field in dataclasses.fields(kind):
            assert f"--{field.name.replace('_', '-')}" in out
    for flag in ("--residual.bandwidth", "--success.height-ratio", "--reward.landed"):
        assert flag in out


def test_flags_reach_the_configuration():
    options = cli.parse(
        EvalOptions,
        ["--jump-height", "0.05", "0.06", "--momentum-control", "False", "--residual_scale", "0.01",
         "0.02", "0.03", "--com-displacement", "0.1", "--solver", "osqp", "--constraints", "hard",
         "--residual.bandwidth", "20", "--success.height-ratio", "0.5"],
    )  # fmt: skip
    assert options.config == JumpConfig.of(
        jump_height=(0.05, 0.06),
        momentum_control=False,
        residual_scale=(0.01, 0.02, 0.03),
        com_displacement=0.1,
        solver="osqp",
        constraints="hard",
    ).replace(
        residual=ResidualConfig((0.01, 0.02, 0.03), bandwidth=20.0),
        success=SuccessConfig(height_ratio=0.5),
    )


def test_models_are_given_by_name_or_json():
    gains = '{"kind": "torque", "com_stiffness": 150, "contact": {"friction": 0.4}}'
    words = ["--controller", gains, "--solver", "osqp", "--sensors", "realistic"]
    assert cli.parse(EvalOptions, words).config == JumpConfig(
        controller=TorqueConfig(
            com_stiffness=150.0, contact=ContactConfig(friction=0.4), solver="osqp"
        ),
        sensors="realistic",
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--wings", "2"], ["--wings"]),
        (["--jump-height", "high"], ["--jump-height", "'high'"]),
        (["--jump-height", "7"], ["jump_height", "7", "0.01 to 0.15"]),
        (["--controller", "psychic"], ["--controller", "psychic", "velocity"]),
        (["--residual-scale", "1"], ["residual_scale", "1.0", "lateral from 0 to 0.1 m"]),
        (["--timestep", "nan"], ["timestep", "nan"]),
        (["--control-frequency", "333"], ["control_frequency", "333", "divisor"]),
        (["--episodes", "0"], ["episodes", "0", "from 1 to 1000000"]),
        (["--seed", "-1"], ["seed", "-1", "from 0"]),
        (["--com-scaling", "acceleration", "--jump-height", "0.1"], ["jump_height", "at most"]),
        (["--json", "/nowhere/at/all.json"], ["json", "/nowhere/at/all.json", "folder"]),
        (["--plot", "/dev/null"], ["plot", "/dev/null", "folder"]),
        (["--video", "jump.txt"], ["video", "jump.txt", ".mp4"]),
        (["--jobs", "0"], ["jobs", "0", "from 1"]),
        (["--sweep", "--view"], ["sweep", "view"]),
        (["--resume"], ["resume", "a single jump"]),
        (["--jobs", "2"], ["jobs", "a single jump"]),
        (["--sweep", "--video", "a.mp4"], ["video", "--sweep"]),
        (["--report", "r", "--json", "a.json"], ["json", "--report"]),
        (["--view", "--episodes", "3"], ["episodes", "--view"]),
        (["--study", "realism", "--resume"], ["resume", "--study"]),
        (["--study", "landing", "--estimator", "imu"], ["estimator", "--study landing"]),
        (["--landing", "feedback"], ["landing", "estimator='imu'"]),
        (["--study", "landing", "--randomization", "hard"], ["randomization", "--study landing"]),
        (["--study", "landing", "--video", "a.mp4"], ["video", "--study landing"]),
        (["--sweep", "--jump-height", "0.05"], ["jump_height", "--sweep"]),
        (["--study", "realism", "--sensors", "realistic"], ["sensors", "--study"]),
        (["--report", "r", "--controller", "torque"], ["controller", "--report"]),
        (["--episodes", "2", "--json", "a", "--results", "./a"], ["json", "another path"]),
        (["--episodes", "2", "--results", "."], ["results", "a file, not a folder"]),
        (["--randomization", "extreme"], ["extreme", "mild", "JSON"]),
        (["--randomization", '{"friction": [1, 0.4]}'], ["friction", "[1, 0.4]", "lower"]),
        (["--actuators", '{"wings": 2}'], ["actuators", "wings"]),
        (["--jump-height", "0.04", "0.06", "--view"], ["(0.04, 0.06)", "one height with --view"]),
        (["--jump-height", "0.04", "0.06", "--report", "r"], ["one height with --report"]),
        (["--jump-height", "0.04", "0.06", "--study", "realism"], ["one height with --study"]),
        (["--jump-height", "0.04", "0.06", "--sweep"], ["one height with --sweep"]),
        (["--jump-height", "0.06", "0.04"], ["jump_height", "lower bound first"]),
        (["--jump-height", "0.04", "0.5"], ["jump_height", "0.5", "0.01 to 0.15"]),
        (["--jump-height", "0.04", "0.05", "0.06"], ["--jump-height", "'0.06'"]),
        (
            ["--com-scaling", "acceleration", "--jump-height", "0.04", "0.1"],
            ["jump_height=0.1", "at most"],
        ),
        (["--compare"], ["compare", "two or more"]),
        (["--compare", "baseline"], ["compare", "baseline", "two or more"]),
        (["--compare", "p.json", "baseline", "p.json"], ["compare", "p.json", "different names"]),
        (["--compare", "a.json", "b.json", "--policy", "c.json"], ["policy", "--compare"]),
        (["--compare", "a.json", "b.json", "--results", "r"], ["results", "--compare"]),
        (["--policy", "p.json", "--sweep"], ["policy", "--sweep"]),
        (["--policy", "p.json", "--study", "realism"], ["policy", "--study"]),
        (["--policy", "p.json", "--report", "r"], ["policy", "--report"]),
    ],
)
def test_refuses_with_one_line_that_names_the_reason(
    capsys, monkeypatch, tmp_path, arguments, words
):
    monkeypatch.chdir(tmp_path)
    for name in {word for word in arguments if word.endswith(".json") and "/" not in word}:
        save_constant(tmp_path / name, 0, 0, 0)
    code, out, err = evaluate(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


def test_a_missing_extra_names_the_remedy(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio", None)
    monkeypatch.setitem(sys.modules, "imageio.v3", None)
    code, _, err = evaluate(capsys, "--video", "jump.mp4")
    assert code == 2
    assert err.count("\n") == 1
    assert 'pip install -c constraints.txt -e ".[video]"' in err


def test_missing_opengl_names_the_remedy(monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    with pytest.raises(MissingDependencyError, match="unset it to render with EGL"):
        video.check_video(Path("jump.mp4"))


def test_interrupt_ends_with_one_line(capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("icub_jump_env.evaluation.modes.nominal.run_episode", interrupted)
    code, _, err = evaluate(capsys)
    assert code == 130
    assert err.strip().splitlines()[-1] == "interrupted"


def test_json_is_written_completely_or_not_at_all(tmp_path, monkeypatch):
    file = tmp_path / "report.json"
    write_json(file, {"a": 1, "nan": float("nan")})
    assert json.loads(file.read_text()) == {"a": 1, "nan": None}

    def full_disk(_):
        raise OSError("no space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space"):
        write_json(file, {"a": 2})
    assert json.loads(file.read_text())["a"] == 1
    assert list(tmp_path.iterdir()) == [file]


def test_options_refuse_with_the_field():
    with pytest.raises(ConfigError) as refusal:
        EvalOptions(episodes=0)
    assert refusal.value.field == "episodes"


def test_tables_are_whole_in_a_narrow_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    _, out, _ = evaluate(capsys, "--stand-time", "0.1")
    assert "difference" in out
    assert "\N{HORIZONTAL ELLIPSIS}" not in out


def test_refusals_are_one_plain_line_in_a_terminal():
    """tyro decorates what it prints where it sees a terminal."""
    terminal, inside = pty.openpty()
    result = subprocess.run(
        [sys.executable, str(REPOSITORY / "eval.py"), "--wings", "2"],
        stdout=inside, stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    os.close(inside)
    os.close(terminal)
    assert result.returncode == 2
    assert result.stderr == "error: Unrecognized options: --wings, 2\n"


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["--jump-hight", "0.05"], "--jump-hight, 0.05; did you mean --jump-height?"),
        (["--sweepp"], "--sweepp; did you mean --sweep?"),
        (["--sede", "1", "--solvr", "osqp"], "osqp; did you mean --seed or --solver?"),
        (["--wings", "2"], "--wings, 2"),
    ],
)
def test_a_misspelt_flag_is_told_the_nearest(capsys, words, meant):
    code, out, err = evaluate(capsys, *words)
    assert (code, out) == (2, "")
    assert err.startswith("error: Unrecognized options: ")
    assert err.endswith(f"{meant}\n")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "words",
    [
        ("--actuators", "[" * 100_000),
        ("--sensors", "[" * 900 + "]" * 900),
        ("--sensors", '{"tilt": ' + "[" * 900 + "]" * 900 + "}"),
        ("--actuators", '{"motor": ' * 200 + "1" + "}" * 200),
        ("--sensors", '{"delay": 1' + "0" * 100_000 + "}"),
        ("--actuators", "\x1b[31m\x07"),
        ("--actuators", json.dumps({"\x1b[31m\n": "\x1b"})),
        ("--jump-height", "\x1b[31m\n"),
        ("--\x1b[31m",),
    ],
    ids=range(9),
)
def test_whatever_is_given_the_refusal_is_one_printable_line(capsys, words):
    code, out, err = evaluate(capsys, *words)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.removesuffix("\n").isprintable()
    assert len(err) <= 2100


def test_paths_are_not_taken_for_markup(capsys, tmp_path):
    report = tmp_path / "[red]r[" / "q[b].json"
    report.parent.mkdir()
    code, _, err = evaluate(capsys, "--stand-time", "0.1", "--json", str(report))
    assert code == 0
    assert f"wrote {report}\n" in err


def test_what_is_said_is_one_line_without_orders_for_the_terminal(capsys, tmp_path):
    report = tmp_path / "a\x1b[31m\nb.json"
    code, _, err = evaluate(capsys, "--stand-time", "0.1", "--json", str(report))
    assert code == 0
    assert err == rf"wrote {tmp_path}/a\x1b[31m\nb.json" + "\n"


def test_json_is_written_though_nobody_reads_the_table(tmp_path):
    command = [sys.executable, str(REPOSITORY / "eval.py"), *ONE_EPISODE, "--json", "j"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        process.stdout.close()
    assert json.loads((tmp_path / "j").read_text())["mode"] == "statistics"


def test_eval_py_runs_from_anywhere(tmp_path):
    result = subprocess.run(
        [sys.executable, str(REPOSITORY / "eval.py"), "--jump-height", "9"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 2
    assert (
        result.stderr
        == "error: jump_height=9.0 is not allowed: expected a number from 0.01 to 0.15 m\n"
    )


class TestSeveralJumps:
    @pytest.mark.parametrize("arguments", [[], ["--randomization", "full", "--episodes", "2"]])
    def test_says_how_many_landed_in_a_row(self, capsys, arguments):
        code, out, _ = evaluate(capsys, "--jumps", "2", "--stand-time", "0.1", *arguments)
        assert code == 0
        assert "jumps landed in a row: 2 of 2; complete series: 100.0 % (2 of 2;" in out

    @pytest.mark.parametrize("mode", [["--sweep"], ["--study", "realism"], ["--plot", "folder"]])
    def test_is_refused_where_one_is_meant(self, capsys, mode):
        code, _, err = evaluate(capsys, "--jumps", "2", *mode)
        assert code == 2
        assert "jumps=2 is not allowed: expected 1 with" in err
