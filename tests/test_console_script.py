"""The command ``icub-jump``: its two commands are those of eval.py and train.py."""

import sys

import pytest

from icub_jump_env import cli


@pytest.fixture
def icub_jump(monkeypatch, capsys):
    """Exit code, stdout and stderr of the command with these words."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["icub-jump", *words])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code or 0
        return code, *capsys.readouterr()

    return run


@pytest.mark.parametrize("words", [(), ("-h",), ("--help",)])
def test_help_names_the_commands(icub_jump, words):
    code, out, err = icub_jump(*words)
    assert (code, err) == (0, "")
    assert [line.split()[:2] for line in out.splitlines()] == [
        ["icub-jump", name]
        for name in ("eval", "view", "train", "plan", "bench", "export", "--version")
    ]


def test_another_command_is_refused_in_one_line(icub_jump):
    assert icub_jump("fly", "--help") == (
        2,
        "",
        "error: 'fly' is none of eval, view, train, plan, bench, export\n",
    )


@pytest.mark.parametrize(
    ("command", "flags"),
    [
        ("eval", ("--jump-height", "--compare", "--study")),
        ("train", ("--jump-height", "--ppo.log-std", "--timesteps")),
        ("view", ("--jump-height", "--camera")),
        ("plan", ("--robot", "--output")),
        ("bench", ("--controller", "--table")),
        ("export plan", ("--planner", "FILE.csv")),
    ],
)
def test_each_command_has_its_help(icub_jump, command, flags):
    code, out, err = icub_jump(*command.split(), "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"usage: icub-jump {command} [")
    assert "`" not in out
    for flag in flags:
        assert flag in out


@pytest.mark.parametrize("command", ["eval", "train"])
def test_each_command_gets_the_words_that_follow(icub_jump, command):
    message = "error: jump_height=9.0 is not allowed: expected a number from 0.01 to 0.15"
    code, out, err = icub_jump(command, "--jump-height", "9")
    assert (code, out) == (2, "")
    assert err.startswith(message)
    assert err.count("\n") == 1


def test_the_version_names_what_a_jump_depends_on(icub_jump):
    code, out, err = icub_jump("--version")
    assert (code, err) == (0, "")
    assert {"icub-jump", "mujoco", "daqp"} <= {line.split()[0] for line in out.splitlines()}


def test_an_interrupt_while_python_imports_ends_quietly(icub_jump, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("icub_jump_env.evaluation.cli.evaluate", interrupted)
    assert icub_jump("eval") == (130, "", "")
