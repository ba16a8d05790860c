"""A dataset: Minari reads it, and the environment that it names repeats it."""

import minari
import numpy as np
import pytest

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.export.dataset import write_dataset
from icub_jump_env.policy import load_policy


def test_the_recovered_environment_repeats_the_episodes(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    policy = load_policy("velocity")
    config = JumpConfig.of(
        jump_height=(0.04, 0.06), com_displacement=0.09, randomization="hard", stand_time=0.1
    )
    folder = write_dataset("icub/jump/test-v0", config, policy, [7, 8], "velocity")
    assert tmp_path in folder.parents
    with pytest.raises(ConfigError, match="there is one called so"):
        write_dataset("icub/jump/test-v0", config, policy, [7, 8], "velocity")
    dataset = minari.load_dataset("icub/jump/test-v0")
    assert dataset.spec.total_episodes == 2
    env = dataset.recover_environment()
    for seed, episode in zip([7, 8], dataset.iterate_episodes(), strict=True):
        observation, _ = env.reset(seed=seed)
        observations, rewards = [observation], []
        for action in episode.actions:
            np.testing.assert_array_equal(action, policy(observation))
            observation, reward, terminated, _, _ = env.step(action)
            observations.append(observation)
            rewards.append(reward)
        np.testing.assert_array_equal(episode.observations, observations)
        np.testing.assert_array_equal(episode.rewards, rewards)
        assert terminated
        assert list(np.flatnonzero(episode.terminations)) == [len(rewards) - 1]
