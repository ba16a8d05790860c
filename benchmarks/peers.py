"""Time our control tick beside those of its peers, in turn, on one core.

Each peer decides at the same states of the same robot, along our nominal launch, in a process
and, where its versions clash with ours, in a virtual environment of its own, which is made at the
first call. What each peer solves stands in its file in ``peer_ticks``.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/peers.py --json peers.json
"""

from __future__ import annotations

import argparse
import copy
import json
import os
import random
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.planning.residual import N_AXES
from icub_jump_env.robot.kinematics import FeetFixedKinematics

HERE = Path(__file__).parent / "peer_ticks"
OURS: dict[str, str] = {
    "ours, velocity": "velocity",
    "bare DAQP, velocity": "velocity",
    "pink": "velocity",
    "mink": "velocity",
    "placo kinematics": "velocity",
    "qpsolvers with OSQP": "velocity",
    "ours, torque": "torque",
    "bare DAQP, torque": "torque",
    "placo dynamics": "torque",
    "tsid": "torque",
    "mj_step": "velocity",
}
"""With which of our ticks each is compared, in the order of the table."""


@dataclass(frozen=True)
class Peer:
    """Somebody else's controller.

    Attributes:
        script: Of :data:`HERE`; it offers ticks by name.
        packages: What its own environment needs; none: ours.
    """

    script: str
    packages: tuple[str, ...] = ()


PEERS = (
    Peer("tick_ours"),
    Peer("tick_pink", ("pin==4.1.0", "pin-pink==4.4.0", "daqp==0.11.0")),
    Peer("tick_mink", ("mink==1.3.0", "mujoco==4.0.0", "daqp==0.11.0")),
    Peer("tick_placo", ("placo==0.10.2", "pin==3.8.0")),
    Peer("tick_tsid", ("tsid==1.7.1", "pin==3.4.0", "cmeel-urdfdom<5", "cmeel-tinyxml2<11")),
    Peer("tick_plain", ("pin==4.1.0", "qpsolvers==4.13.0", "osqp==1.1.3")),
)


def write_launch(folder: Path, name: ControllerName) -> None:
    """Leave the robot and the states along a controller's nominal launch in a folder."""
    env = make_env(JumpConfig.of(controller=name))
    env.reset(seed=0)
    readings = []
    while env._controller.launching:
        found = env._simulation.sensors.readings
        readings.append((found.joint_position.copy(), found.joint_velocity.copy()))
        env._control_tick(np.zeros(N_AXES))
    plan: JumpPlan = env._controller.plan
    dt, robot = env.config.control_dt, env.robot
    env.close()
    kinematics = FeetFixedKinematics(robot)
    setpoints = [copy.deepcopy(plan.sample(dt * tick)) for tick in range(len(readings))]
    velocities = np.array([setpoint.com_velocity for setpoint in setpoints])
    accelerations = np.array([setpoint.com_acceleration for setpoint in setpoints])
    q = [kinematics.configuration(s) for s, _ in readings]
    v = []
    for s, s_dot in readings:
        kinematics.update(s)
        v.append(np.concatenate((-kinematics.J_left @ s_dot[robot.left_leg], s_dot)))
    (folder / "robot.urdf").write_text(robot.urdf())
    np.savez(
        folder / f"{name}.npz",
        joints=robot.joint_names,
        q=q,
        v=v,
        com_velocity=velocities,
        com_acceleration=accelerations,
        dt=dt,
    )


def interpreter(peer: Peer, folder: Path, console: Console) -> str:
    """Python of a peer; its environment is made where there is none yet.

    Raises:
        subprocess.CalledProcessError: If its packages cannot be had.
    """
    if not peer.packages:
        return sys.executable
    home = folder / peer.script.removeprefix("tick_")
    python, done = home / "bin" / "python", home / "installed"
    if not done.exists() or done.read_text() != " ".join(peer.packages):
        console.print(f"installing {', '.join(peer.packages)} into {home}")
        venv.create(home, with_pip=True, clear=True)
        install = [python, "-m", "pip", "install", "--quiet", *peer.packages]
        subprocess.run(install, check=True, capture_output=True)
        done.write_text(" ".join(peer.packages))
    return str(python)


class Worker:
    """A process that times ticks.

    Attributes:
        ticks: Their names.
        notes: What it says of them.
    """

    def __init__(self, python: str, script: str, launches: Path) -> None:
        """Start it.

        Raises:
            RuntimeError: If it ends before it offers a tick.
        """
        environment = os.environ | {
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "MKL_NUM_THREADS": "1",
        }
        self._process = subprocess.Popen(
            [python, HERE / f"{script}.py", launches],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        offered = self._answer()
        self.ticks: list[str] = offered["ticks"]
        self.notes = offered["notes"]

    def time(self, tick: str) -> list[float]:
        """Durations of a tick at all states (us)."""
        assert self._process.stdin is not None
        print(tick, file=self._process.stdin, flush=True)
        return self._answer()

    def close(self) -> None:
        """End it."""
        self._process.communicate()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith(("{", "[")):  # libraries print, too
                return json.loads(line)
        _, error = self._process.communicate()
        raise RuntimeError(error.strip().splitlines()[-1] if error.strip() else "ended")


@contextmanager
def workers(launches: Path, environments: Path, console: Console) -> Iterator[list[Worker]]:
    """All peers that can be had; those missing are named on the console."""
    started = []
    try:
        for peer in PEERS:
            try:
                python = interpreter(peer, environments, console)
                started.append(Worker(python, peer.script, launches))
            except (subprocess.CalledProcessError, RuntimeError, OSError) as error:
                console.print(f"without {peer.script.removeprefix('tick_')}: {error}")
        yield started
    finally:
        for worker in started:
            worker.close()


def measure(ready: list[Worker], rounds: int) -> dict[str, np.ndarray]:
    """Durations (us) by tick, (rounds, states); each round times all in another order."""
    jobs = [(tick, worker) for worker in ready for tick in worker.ticks]
    order = random.Random(0)
    durations: dict[str, list[list[float]]] = {tick: [] for tick, _ in jobs}
    for number in range(rounds + 1):
        order.shuffle(jobs)
        for tick, worker in jobs:
            found = worker.time(tick)
            if number > 0:  # the first round warms up
                durations[tick].append(found)
    return {tick: np.array(found) for tick, found in durations.items()}


def summary(durations: dict[str, np.ndarray], active: dict[str, list[bool]]) -> dict[str, Any]:
    """Medians, tails and ratios by tick.

    A ratio is ours over that tick: of the medians of a round, then 10, 50 and 90 % over rounds.
    """
    rows = {}
    for tick, name in OURS.items():
        if tick not in durations:
            continue
        found = durations[tick]
        own = np.median(durations[f"ours, {name}"], axis=1)
        low, middle, high = np.percentile(own / np.median(found, axis=1), [10, 50, 90])
        rows[tick] = {
            "median": float(np.median(found)),
            "p99": float(np.percentile(found, 99)),
            "worst": float(found.max()),
            "ours_over_it": [float(low), float(middle), float(high)],
        }
        if tick in active:
            at_limits = np.array(active[tick])
            for which, chosen in (("active", at_limits), ("inactive", ~at_limits)):
                part = found[:, chosen]
                rows[tick][which] = {
                    "states": int(chosen.sum()),
                    "median": float(np.median(part)) if chosen.any() else None,
                }
    return rows


def render(rows: dict[str, Any], rounds: int) -> Table:
    """The summary as a table."""
    table = Table(title=f"Control ticks, us; {rounds} rounds in turn", title_justify="left")
    table.add_column("tick")
    for heading in ("median", "99 %", "worst", "ours / it", "10 to 90 %"):
        table.add_column(heading, justify="right")
    for tick, row in rows.items():
        low, middle, high = row["ours_over_it"]
        table.add_row(
            tick,
            *(f"{row[key]:.1f}" for key in ("median", "p99", "worst")),
            f"{middle:.2f}",
            f"{low:.2f} to {high:.2f}",
            end_section=tick == "qpsolvers with OSQP" or tick == "tsid",
        )
    for tick, row in rows.items():
        for which in ("inactive", "active"):
            part = row.get(which)
            if part and part["median"] is not None:
                name = f"{tick}, limits {which} ({part['states']} states)"
                table.add_row(name, f"{part['median']:.1f}", "", "", "", "")
    return table


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    parser.add_argument(
        "--environments",
        type=Path,
        default=Path("results/peers"),
        help="folder of the peers' virtual environments",
    )
    arguments = parser.parse_args()
    console = Console()
    with tempfile.TemporaryDirectory() as folder:
        for name in ("velocity", "torque"):
            write_launch(Path(folder), name)
        with workers(Path(folder), arguments.environments, console) as ready:
            durations = measure(ready, arguments.rounds)
            active = {k: v for w in ready for k, v in (w.notes or {}).items()}
    rows = summary(durations, active)
    console.print(render(rows, arguments.rounds))
    if arguments.json is not None:
        arguments.json.write_text(
            json.dumps({"rounds": arguments.rounds, "ticks": rows}, indent=1)
        )


if __name__ == "__main__":
    main()
