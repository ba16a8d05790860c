"""Episodes as a Minari dataset, for offline learning."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from pathlib import Path

import gymnasium

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import check_own
from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.policy import Policy
from icub_jump_env.versions import ENV_ID


def write_dataset(
    name: str, config: JumpConfig, policy: Policy, seeds: Sequence[int], algorithm: str
) -> Path:
    """Record episodes into Minari's folder (``MINARI_DATASETS_PATH``).

    Args:
        name: As Minari's names are: ``icub/jump/baseline-v0``.
        config: The jump.
        policy: What acts.
        seeds: One for each episode.
        algorithm: What the dataset says that acts.

    Returns:
        Its folder.

    Raises:
        ConfigError: If there is one of that name, Minari refuses the name, or the controller is of
            a class that no file can hold.
        MissingDependencyError: Without the package ``minari``.
    """
    try:
        import h5py  # noqa: F401 (Minari writes with it)
        import minari
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_dataset import parse_dataset_id
    except ImportError:
        raise MissingDependencyError.of_extra("a dataset", "export") from None
    try:
        parse_dataset_id(name)
    except (ValueError, TypeError) as error:
        raise ConfigError("dataset", name, f"a name such as icub/jump/mine-v0: {error}") from None
    if name in minari.list_local_datasets():
        raise ConfigError("dataset", name, "another name: there is one called so")
    check_own(config.controller_config)
    env = gymnasium.make(ENV_ID, **dataclasses.asdict(config))
    episodes = []
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        episode = EpisodeBuffer(seed=seed, observations=[observation], actions=[])
        while not (episode.terminations and episode.terminations[-1]):
            action = policy(observation)
            observation, reward, terminated, truncated, _ = env.step(action)
            episode.observations.append(observation)
            episode.actions.append(action)
            episode.rewards.append(reward)
            episode.terminations.append(terminated)
            episode.truncations.append(truncated)
        episodes.append(episode)
    env.close()
    with warnings.catch_warnings():
        # Who publishes a dataset knows author and code; they can be added then.
        warnings.filterwarnings("ignore", "`(code_permalink|author|author_email)` is set to None")
        dataset = minari.create_dataset_from_buffers(
            name,
            episodes,
            env,
            eval_env=env,
            algorithm_name=algorithm,
            description=f"Jumps of the iCub: {config.controller_name} controller, {algorithm}",
        )
    return Path(dataset.storage.data_path)
