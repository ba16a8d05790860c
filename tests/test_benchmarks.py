"""Benchmarks: they start after every change of the package."""

import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]


@pytest.mark.parametrize(
    "script", sorted((REPOSITORY / "benchmarks").glob("*.py")), ids=lambda file: file.stem
)
def test_a_benchmark_shows_its_help(script):
    shown = subprocess.run(
        [sys.executable, script, "--help"], capture_output=True, text=True, check=True
    )
    assert shown.stdout.startswith(f"usage: {script.name}")
