"""Any command line is taken, or ends with one line and a non-zero exit."""

import contextlib
import io
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.benchmark.cli import BenchOptions
from icub_jump_env.evaluation.cli import default_config, guarded, parse
from icub_jump_env.evaluation.entry import parse_entry
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.planning.__main__ import PlanningOptions


def evaluation(words):
    return parse(EvalOptions, words, EvalOptions(config=default_config(words)))


def benchmark(words):
    return parse_entry(BenchOptions, words, file=Path("result.json"))


def plans(words):
    return parse(PlanningOptions, words)


def help_of(command):
    page = io.StringIO()
    with contextlib.redirect_stdout(page), contextlib.suppress(SystemExit):
        command(["--help"])
    return page.getvalue()


COMMANDS = {command: help_of(command) for command in (evaluation, benchmark, plans)}
FLAGS = {
    command: sorted(set(re.findall(r"--[\w.-]+", page)) - {"--help"})
    for command, page in COMMANDS.items()
}
VALUES = st.one_of(
    st.sampled_from(
        ["0", "1", "-1", "nan", "inf", "1e400", "0.05", "none", "None", "True", "full", "torque", "{}",
         "[]", '{"a": 1}', "[[[", "", " ", "--", "-", "=", "\x1b[31m", "\n", "ä", "iCubGenova02"]
    ),
    st.floats().map(str),
    st.integers().map(str),
    st.text(max_size=6),
)  # fmt: skip


@st.composite
def lines(draw):
    """A command, and words for it: mostly its flags, each with some values."""
    command = draw(st.sampled_from(sorted(COMMANDS, key=lambda each: each.__name__)))
    words = []
    for flag in draw(st.lists(st.sampled_from(FLAGS[command]) | VALUES, max_size=3)):
        words += [flag, *draw(st.lists(VALUES, max_size=2))]
    return command, words


@pytest.mark.fault("command lines")
@given(lines())
def test_any_command_line_is_taken_or_refused_in_one_line(line):
    command, words = line
    said, code = io.StringIO(), 0
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            guarded(lambda: command(words))
        except SystemExit as end:
            code = end.code
    if code == 0:
        assert said.getvalue() == ""
    else:
        assert code == 2
        assert re.fullmatch(r"error: [^\n]+\n", said.getvalue())
        assert said.getvalue()[:-1].isprintable()
