"""NaN and absurd numbers anywhere in the state or the model: the episode ends, the next one is clean."""

import math

import gymnasium
import numpy as np
import pytest

from icub_jump_env.versions import VERSIONS

ABSURD = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e11, 1e6)
STATE = ("qpos", "qvel", "ctrl", "qfrc_applied", "xfrc_applied", "qacc_warmstart")
MODEL = ("body_mass", "body_inertia", "dof_damping", "dof_armature", "geom_friction", "jnt_range")
ACTION = np.zeros(3, np.float32)


@pytest.mark.fault("absurd numbers")
@pytest.mark.parametrize("version", VERSIONS)
def test_absurd_numbers_end_the_episode_and_leave_no_trace(many, rng, version):
    env = gymnasium.make(version).unwrapped
    clean = [env.reset(seed=0)[0], *(env.step(ACTION)[0] for _ in range(20))]
    for _ in range(many(20, 2000)):
        env.reset(seed=0)
        for _ in range(rng.integers(1, 60)):
            env.step(ACTION)
        owner = env.data if rng.random() < 0.5 else env.model
        name = rng.choice(STATE if owner is env.data else MODEL)
        values = getattr(owner, name)
        kept = values.copy()
        values.flat[rng.integers(values.size)] = rng.choice(ABSURD)
        for _ in range(1000):  # a robot that is stuck sways for seconds before it falls
            observation, reward, terminated, _, info = env.step(ACTION)
            assert np.isfinite(observation).all()
            assert math.isfinite(reward)
            if terminated:
                break
        assert terminated
        if name in ("qpos", "qvel"):
            assert info["outcome"] == "diverged"
        elif name == "ctrl":  # written anew at each tick
            assert info["outcome"] == "stood"
        values[:] = kept
    again = [env.reset(seed=0)[0], *(env.step(ACTION)[0] for _ in range(20))]
    np.testing.assert_array_equal(again, clean)
