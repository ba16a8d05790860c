"""The physics steps of a control tick: compiled, or one by one through ``mujoco.mj_step``.

Both call the same functions in the same order, so that both give the same bits. Compiled, nothing
but MuJoCo's C library sees the steps; whoever patches ``mujoco.mj_step`` to watch them asks for
``physics_loop="python"``.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import mujoco
import numba
from llvmlite import binding

from icub_jump_env.compiled import compiled
from icub_jump_env.metrics.recorder import watch
from icub_jump_env.metrics.series import RUNNING, judge
from icub_jump_env.records import Array, Block
from icub_jump_env.simulation.actuators.actuators import actuate
from icub_jump_env.simulation.disturbances import comes, push
from icub_jump_env.simulation.ground_truth import read_truth

EVENT, DIVERGED = -1, -2
"""Why the steps ended, beside what :func:`icub_jump_env.metrics.series.judge` says: a disturbance is
due before the next one; MuJoCo warned."""


def _find_mj_step() -> Any:
    """MuJoCo's ``mj_step`` as compiled code calls it, with the addresses of model and data."""
    (library,) = sorted(Path(mujoco.__file__).parent.glob("*mujoco*.so.*"))
    address = ctypes.cast(ctypes.CDLL(str(library)).mj_step, ctypes.c_void_p).value
    binding.add_symbol("mj_step", address)
    signature = numba.types.void(numba.types.intp, numba.types.intp)
    return numba.types.ExternalFunction("mj_step", signature)


mj_step = _find_mj_step()

Arrays = tuple[Any, ...]


@compiled
def before_step(
    time: float,
    position: Array,
    velocity: Array,
    encoder_bias: Array,
    drives: Block,
    motor: Array,
    joint_force: Array,
    awaited: Block,
    chest_force: Array,
) -> None:
    """Set the forces of a step.

    Args:
        time: When it begins (s).
        position: (n,) of the joints (rad).
        velocity: (n,) rad/s.
        encoder_bias: (n,) rad.
        drives: Block of the actuators.
        motor: (n,) torques of the motors (Nm), which this sets.
        joint_force: (n,) other torques on the joints (Nm), likewise.
        awaited: Block of the disturbances.
        chest_force: (3,) external force on the chest (N), likewise.
    """
    actuate(position + encoder_bias, velocity, drives, motor)
    for j in range(joint_force.shape[0]):
        joint_force[j] = -drives[0].friction[j]
    push(time, awaited, chest_force)


@compiled
def take_steps(
    model: int,
    data: int,
    time: float,
    dt: float,
    steps: int,
    noticed: bool,
    forces: Arrays,
    warnings: Array,
    sources: Arrays,
    state: Block,
    limits: Block,
    rules: Block,
    record: Block,
) -> tuple[int, int]:
    """Take physics steps, and watch the true state after each.

    Args:
        model: Address of MuJoCo's model.
        data: Address of its data.
        time: Of the episode (s).
        dt: Physics step (s).
        steps: How many at most.
        noticed: Whether the event that is due now has been seen to.
        forces: Arguments of :func:`before_step` but for the time.
        warnings: How often MuJoCo warned, by kind.
        sources: Arguments of :func:`icub_jump_env.simulation.ground_truth.read_truth` but for time
            and state.
        state: Block of the true state.
        limits: Block of the limits of a :class:`icub_jump_env.metrics.recorder.JumpRecorder`.
        rules: Block of those of a :class:`icub_jump_env.metrics.series.SeriesRecorder`.
        record: Block of what the former has.

    Returns:
        How many steps were taken, and why no more.
    """
    sensordata, awaited = sources[0], forces[6]
    for step in range(steps):
        if not noticed and comes(sensordata, awaited):
            return step, EVENT
        noticed = False
        before_step(time, *forces)
        mj_step(model, data)
        outcome = after_step(time, warnings, sources, state, limits, rules, record)
        if outcome != RUNNING:
            return step + 1, outcome
        time += dt
    return steps, RUNNING


@compiled
def after_step(
    time: float,
    warnings: Array,
    sources: Arrays,
    state: Block,
    limits: Block,
    rules: Block,
    record: Block,
) -> int:
    """Watch the true state; arguments as of :func:`take_steps`, ``time`` that of the step."""
    if warnings.any():
        return DIVERGED
    read_truth(time, state, *sources)
    watch(state, limits, record)
    return judge(state, rules, record)


@compiled
def settle(model: int, data: int, dt: float, steps: int, forces: Arrays) -> None:
    """Take physics steps that nobody watches; arguments as of :func:`take_steps`."""
    for step in range(steps):
        before_step(step * dt, *forces)
        mj_step(model, data)
