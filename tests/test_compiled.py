"""Compiled functions: kept on disk for as long as nothing that they are made of changes."""

import os
import shutil
import subprocess
import sys

import pytest

from icub_jump_env import compiled

INNER = "from package.compiled import compiled\n@compiled\ndef inner(x): return x + {}\n"
OUTER = (
    "from package.compiled import compiled\n"
    "from package.inner import inner\n"
    "@compiled\n"
    "def outer(x): return 10.0 * inner(x)\n"
)
SAID = "package: compiling, once for each kind of jump\n"


@pytest.fixture
def package(tmp_path):
    """A package that compiles as ours does, with a function that calls one of another file."""
    folder = tmp_path / "package"
    folder.mkdir()
    shutil.copy(compiled.__file__, folder / "compiled.py")
    (folder / "__init__.py").touch()
    (folder / "inner.py").write_text(INNER.format(1.0))
    (folder / "outer.py").write_text(OUTER)
    return folder


def run(package, program="from package.outer import outer; print(outer(2.0))"):
    """What a program in a process of its own prints, and says beside it."""
    environment = os.environ | {"PYTHONPATH": str(package.parent)}
    environment.pop("NUMBA_CACHE_DIR", None)
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout, done.stderr


def test_they_are_compiled_once(package):
    assert run(package) == ("30.0\n", SAID)
    assert run(package) == ("30.0\n", "")


def test_a_change_in_another_file_counts(package):
    run(package)
    (package / "inner.py").write_text(INNER.format(2.0))
    assert run(package) == ("40.0\n", SAID)
    assert run(package) == ("40.0\n", "")


def test_nothing_is_said_of_functions_of_others(package):
    program = (
        "import numba, package.compiled\n"
        "@numba.njit\n"
        "def theirs(x): return x + 5.0\n"
        "print(theirs(1.0))\n"
    )
    assert run(package, program) == ("6.0\n", "")
