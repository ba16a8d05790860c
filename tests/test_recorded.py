"""Jumps as they were recorded: who changes what the robot does has to say why.

    python tests/test_recorded.py        # record anew

Other processors round otherwise. A small error grows by a factor of 200 at most in these jumps, so that
rounding stays far below the tolerance.
"""

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

RECORDED = Path(__file__).with_name("recorded.json")
WORLDS = {
    "as planned": {},
    "in a hard world": {"randomization": "hard", "actuators": "realistic", "sensors": "realistic"},
}
JUMPS = {
    f"{name}, {controller}, {world}": (name, {"controller": controller, **options})
    for name in ("ICubJump-v0", "ICubJump-v1")
    for controller in ("velocity", "torque")
    for world, options in WORLDS.items()
}
STEPS = (20, 40, 60, 100, 200)
"""Of 10 ms: in the launch, around the flight, and after it."""
TOLERANCE = 1e-8


def run(name, options):
    """Positions (``qpos``) at these steps, and the metrics of the jump, by name."""
    env = gymnasium.make(f"icub_jump_env:{name}", jump_height=0.05, **options).unwrapped
    env.reset(seed=1)
    found, step, done = {}, 0, False
    while not done:
        *_, done, _, info = env.step(np.zeros(3, np.float32))
        step += 1
        if step in STEPS:
            found[str(step)] = env.data.qpos.tolist()
    metrics = {key: np.ravel(value).astype(float).tolist() for key, value in info["jump"].items()}
    return found | metrics


@pytest.mark.parametrize("jump", JUMPS)
def test_nothing_has_changed(jump):
    recorded, found = json.loads(RECORDED.read_text())[jump], run(*JUMPS[jump])
    assert found.keys() == recorded.keys() >= {str(step) for step in STEPS}
    for name, values in recorded.items():
        np.testing.assert_allclose(found[name], values, TOLERANCE, TOLERANCE, err_msg=name)


def main():
    """Write what the jumps are now."""
    jumps = {jump: run(*how) for jump, how in JUMPS.items()}
    lines = (
        f" {json.dumps(jump)}: {{\n"
        + ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in found.items())
        + "\n }"
        for jump, found in jumps.items()
    )
    RECORDED.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
