"""What all peers share: the states at which they decide, and answering the one who times them.

This file runs in the peers' own environments, too, so it needs numpy alone.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

WARM_UP = 20
"""Ticks before the first timed one."""


class Launch:
    """States along a nominal launch, and the robot.

    Attributes:
        urdf: Path of the robot's URDF.
        joints: Names of the n joints, in the order of Pinocchio.
        q: (k, n + 7) Pinocchio configurations.
        v: (k, n + 6) Pinocchio velocities.
        com_velocity: (k, 3) planned velocities of the CoM (m/s).
        com_acceleration: (k, 3) planned accelerations (m/s^2).
        dt: Control period (s).
    """

    def __init__(self, folder: str, controller: str) -> None:
        """Read what the driver left in a folder."""
        self.urdf = str(Path(folder) / "robot.urdf")
        with np.load(Path(folder) / f"{controller}.npz") as file:
            self.joints: list[str] = file["joints"].tolist()
            self.q, self.v = file["q"], file["v"]
            self.com_velocity = file["com_velocity"]
            self.com_acceleration = file["com_acceleration"]
            self.dt = float(file["dt"])


def serve(ticks: dict[str, tuple[Launch, Callable[[int], object]]], notes: object = None) -> None:
    """Say which ticks there are; for each name that comes in, time that tick at all states.

    Args:
        ticks: By name, where it decides, and the call with the number of a state.
        notes: Said along with the names.
    """
    for launch, tick in ticks.values():
        for state in range(min(WARM_UP, len(launch.q))):
            tick(state)
    print(json.dumps({"ticks": list(ticks), "notes": notes}), flush=True)
    clock = time.perf_counter_ns
    for line in sys.stdin:
        launch, tick = ticks[line.strip()]
        durations = []
        for state in range(len(launch.q)):
            start = clock()
            tick(state)
            durations.append((clock() - start) / 1e3)
        print(json.dumps(durations), flush=True)
