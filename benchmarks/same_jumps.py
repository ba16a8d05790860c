"""Compare the jumps of two checkouts, bit for bit.

Runs the same episodes with random residuals in both: each controller with each solver, each
preset of randomisation, sensors and actuators by itself, and the other switches of
``ICubJump-v0``. Compares observations, rewards, infos and the true trajectory; where bits
differ, prints how far the numbers are apart. Entries of the info that only one checkout has
are left out.

    git worktree add ../before COMMIT
    python benchmarks/same_jumps.py ../before .

Exits with 1 if anything differs. ``--record FILE`` notes the jumps of the package that Python
finds; such a file can stand in for a checkout.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

SEEDS = (0, 1, 2)

Record = dict[str, np.ndarray]
"""Numbers of one episode by name; the first axis of each is the step."""


def cases() -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and keywords of ``gymnasium.make`` of every kind of jump."""
    presets = {
        "randomization": ("mild", "full", "hard"),
        "sensors": ("realistic",),
        "actuators": (
            "torque_feedback",
            "current_control",
            "dc_motor",
            "original_limits",
            "realistic",
        ),
    }
    switches: dict[str, dict[str, Any]] = {
        "nominal": {},
        "6 cm after 9 cm": {"jump_height": 0.06, "com_displacement": 0.09},
        "drawn command": {"jump_height": (0.03, 0.07)},
        "by acceleration": {"com_scaling": "acceleration"},
        "without momentum control": {"momentum_control": False},
        "residual in all phases": {"residual_phases": "all"},
        "wide residual": {"residual_scale": (0.1, 0.05, 0.03)},
        "unshifted ankles": {"ankle_shift": False},
        "delayed commands": {"command_delay": 2},
        "fine steps": {"timestep": 0.0005, "control_frequency": 1000.0},
        "everything at once": {
            "randomization": "hard",
            "sensors": "realistic",
            "actuators": "realistic",
            "command_delay": 1,
        },
    }
    for field, names in presets.items():
        switches |= {f"{field} {name}": {field: name} for name in names}
    for controller in ("velocity", "torque"):
        for solver in ("daqp", "osqp"):
            for name, changes in switches.items():
                keywords = {"controller": controller, "solver": solver, "stand_time": 0.5}
                yield f"{controller}, {solver}, {name}", keywords | changes


def record_all(file: Path, only: str) -> None:
    """Run the cases with the package that Python finds; write their records to ``file``."""
    import gymnasium

    import icub_jump_env

    records: dict[str, Record] = {}
    for name, keywords in cases():
        if only not in name:
            continue
        env = gymnasium.make(icub_jump_env.ENV_ID, **keywords).unwrapped
        for seed in SEEDS:
            records[f"{name}, seed {seed}"] = record(env, seed)
        env.close()
    arrays = {
        f"{case}|{name}": a for case, entries in records.items() for name, a in entries.items()
    }
    with file.open("wb") as output:
        np.savez(output, **arrays)


def record(env: Any, seed: int) -> Record:
    """One episode under random residuals."""
    rng = np.random.default_rng([seed, 1])
    observation, info = env.reset(seed=seed)
    steps = [_numbers(env, observation, 0.0, info)]
    ended = False
    while not ended:
        action = rng.uniform(-1.0, 1.0, 3).astype(np.float32)
        observation, reward, ended, _, info = env.step(action)
        steps.append(_numbers(env, observation, reward, info))
    names = set(steps[0]) | set(steps[-1])
    return {name: np.array([step[name] for step in steps if name in step]) for name in names}


def _numbers(env: Any, observation: Any, reward: float, info: dict[str, Any]) -> dict[str, Any]:
    state = env.snapshot()
    trajectory = {f"trajectory.{name}": value for name, value in vars(state).items()}
    physics = {"state.qpos": env.data.qpos.copy(), "state.qvel": env.data.qvel.copy()}
    infos = {f"info.{name}": value for name, value in _flat(info)}
    return {"observation": observation, "reward": reward, **trajectory, **physics, **infos}


def _flat(info: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in info.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def run_checkout(folder: Path, file: Path, only: str) -> dict[str, Record]:
    """The records of a checkout, made in a process of its own; or those of a file."""
    if folder.is_file():
        return {case: record for case, record in read(folder).items() if only in case}
    settings = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(folder)}
    command = [sys.executable, __file__, "--record", str(file), "--only", only]
    subprocess.run(command, check=True, env=os.environ | settings, cwd=folder)
    return read(file)


def read(file: Path) -> dict[str, Record]:
    """Records from their file."""
    records: dict[str, Record] = defaultdict(dict)
    with np.load(file) as arrays:
        for key in arrays:
            case, _, name = key.partition("|")
            records[case][name] = arrays[key]
    return records


def digest(records: dict[str, Record], names: set[str]) -> str:
    """One hash over all records, of the entries called ``names``."""
    total = hashlib.sha256()
    for case in sorted(records):
        for name in sorted(names & records[case].keys()):
            values = records[case][name]
            text = json.dumps(values.tolist()) if values.dtype.kind in "US" else ""
            total.update(f"{case} {name} {values.shape} {text}".encode())
            if not text:
                total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of two entries; infinite where they are no numbers or misshapen."""
    if np.array_equal(one, other, equal_nan=one.dtype.kind == "f"):
        return 0.0
    if one.shape != other.shape or one.dtype.kind not in "fiub" or other.dtype.kind not in "fiub":
        return np.inf
    gaps = np.abs(one.astype(float) - other.astype(float))
    return float(np.max(np.where(np.isnan(gaps), 0.0, gaps)))


def compare(before: dict[str, Record], after: dict[str, Record]) -> int:
    """Print what differs, and the hashes; returns the number of episodes that differ."""
    shared = {name for record in before.values() for name in record}
    shared &= {name for record in after.values() for name in record}
    differing = 0
    for case in before:
        gaps = {
            name: distance(before[case][name], after[case][name])
            for name in sorted(shared & before[case].keys() & after[case].keys())
        }
        gaps = {name: gap for name, gap in gaps.items() if gap > 0.0}
        if gaps:
            differing += 1
            name = max(gaps, key=lambda name: gaps[name])
            print(f"{case}: {len(gaps)} entries differ, most {name} by {gaps[name]:.3g}")
    print(f"{len(before)} episodes, {differing} differ")
    print(f"before {digest(before, shared)}\nafter  {digest(after, shared)}")
    return differing


def main() -> None:
    """Compare two checkouts, or record one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkouts", type=Path, nargs="*", help="before, after")
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument("--record", type=Path, help="write the records to a file")
    arguments = parser.parse_args()
    if arguments.record is not None:
        record_all(arguments.record, arguments.only)
        return
    if len(arguments.checkouts) != 2:
        parser.error("two checkouts, please: before and after")
    with tempfile.TemporaryDirectory() as scratch:
        before, after = (
            run_checkout(folder.resolve(), Path(scratch) / name, arguments.only)
            for folder, name in zip(arguments.checkouts, ("before", "after"), strict=True)
        )
    sys.exit(1 if compare(before, after) else 0)


if __name__ == "__main__":
    main()
