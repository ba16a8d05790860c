"""Fail if episodes take longer than with the last release, which plays them in turn with this checkout.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/against_release.py

A case fails if the median of the ratios is more than 15 % above 1, by its 95 % interval.
"""

from __future__ import annotations

import argparse
import io
import itertools
import subprocess
import sys
import tarfile
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from compare_speed import compare
from scipy.stats import quantile_test

REPOSITORY = Path(__file__).parents[1]
RELEASE = "dd8b82a89374da084d058edb6281e855bf035300"
LOSS = 0.15
ROUNDS = 20
CASES = ("episode", "episode, v1, hard")


def unpack_release(folder: Path) -> bool:
    """Put the release's files into a folder; whether this clone has them."""
    command = ["git", "archive", "--format=tar", RELEASE]
    archive = subprocess.run(command, cwd=REPOSITORY, capture_output=True)
    if archive.returncode:
        return False
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as content:
        content.extractall(folder, filter="data")
    return True


def main() -> int:
    """Compare; returns the exit status."""
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    slower = False
    with TemporaryDirectory() as name:
        release = Path(name)
        if not unpack_release(release):
            print(f"not compared: this clone is without the release, {RELEASE[:7]}")
            return 0
        for controller, what in itertools.product(("velocity", "torque"), CASES):
            found = compare([release, REPOSITORY], what, controller, ROUNDS)
            ratios = np.array([new["wall"] / old["wall"] for old, new in found])
            interval = quantile_test(ratios, q=1.0, p=0.5).confidence_interval()
            lost = interval.low > 1.0 + LOSS
            slower = slower or lost
            print(
                f"{controller}, {what}: {np.median(ratios):.3f} times as long "
                f"({interval.low:.3f} to {interval.high:.3f}){': slower' if lost else ''}"
            )
    return int(slower)


if __name__ == "__main__":
    sys.exit(main())
