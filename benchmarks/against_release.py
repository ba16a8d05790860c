"""Fail if a step has become slower, beside its physics, than in the last release.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/against_release.py

What counts is the ratio of a step to its ``mj_step`` calls, as in ``bench_env.py``, never a time.
A case fails if its median ratio exceeds the release's by more than 15 % and the noise measured
here: the distance from the median to the lower end of its 95 % interval. ``--write`` notes the
ratios of now, for a release.
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from bench_env import HARD, ours, physics_of, play
from scipy.stats import quantile_test

RELEASE = Path(__file__).with_name("release.json")
LOSS = 0.15

CASES: dict[str, dict[str, Any]] = {
    "velocity": {},
    "torque": {"controller": "torque"},
    "velocity, v1, hard": {"name": "ICubJump-v1", **HARD},
    "torque, v1, hard": {"name": "ICubJump-v1", "controller": "torque", **HARD},
}


def ratios(config: dict[str, Any], episodes: int) -> np.ndarray:
    """Of an episode to its physics, (episodes,)."""
    make = partial(ours, **config)
    env, observed = make(through_python=False), make(through_python=True)
    play(env, 0), play(observed, 0)  # whatever happens once
    return np.array([play(env, s).wall / physics_of(observed, s) for s in range(episodes)])


def main() -> int:
    """Compare; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--episodes", type=int, default=25)
    parser.add_argument("--write", action="store_true", help="note the ratios of now")
    arguments = parser.parse_args()
    found = {what: ratios(config, arguments.episodes) for what, config in CASES.items()}
    medians = {what: float(np.median(values)) for what, values in found.items()}
    if arguments.write:
        told = {what: round(ratio, 3) for what, ratio in medians.items()}
        RELEASE.write_text(json.dumps(told, indent=2) + "\n")
        return 0
    release, slower = json.loads(RELEASE.read_text()), False
    for what, values in found.items():
        now, then = medians[what], release[what]
        noise = now - quantile_test(values, q=now, p=0.5).confidence_interval().low
        lost = now > (1.0 + LOSS) * then + noise
        slower = slower or lost
        print(
            f"{what:20s} step / its mj_steps {now:.2f} +- {noise:.2f}, "
            f"{now / then - 1.0:+.0%} of {then:.2f}{': slower' if lost else ''}"
        )
    return int(slower)


if __name__ == "__main__":
    sys.exit(main())
