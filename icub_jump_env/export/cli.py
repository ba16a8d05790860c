"""Command line of ``icub-jump export``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from icub_jump_env.checks import check_count
from icub_jump_env.errors import ConfigError, InvalidValueError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.entry import EntryOptions, parse_entry

USAGE = """\
icub-jump export policy NAME FILE.onnx      a policy; FILE.json names its inputs and outputs
icub-jump export plan FILE.csv ...          the set points of a launch
icub-jump export jump FILE.csv ...          a jump at its control ticks
icub-jump export dataset NAME ...           episodes as a Minari dataset, named as in icub/jump-v0
icub-jump export jump --help                the options of each\
"""


@dataclass(frozen=True)
class PolicyOptions:
    """Write a policy as ONNX, and beside it a manifest.

    Attributes:
        policy: Name of a shipped policy, or its file.
        file: The model, FILE.onnx; the manifest is FILE.json.
    """

    policy: tyro.conf.Positional[Path]
    file: tyro.conf.Positional[Path]


@dataclass(frozen=True, kw_only=True)
class PlanOptions(EntryOptions):
    """Write the set points of a launch.

    Attributes:
        file: FILE.csv.
    """

    file: tyro.conf.Positional[Path]


@dataclass(frozen=True, kw_only=True)
class JumpOptions(EntryOptions):
    """Write a jump, with a row for each control tick.

    Attributes:
        file: FILE.csv.
        seed: Of the episode.
    """

    file: tyro.conf.Positional[Path]
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count("seed", self.seed, 0)


@dataclass(frozen=True, kw_only=True)
class DatasetOptions(EntryOptions):
    """Record episodes as a Minari dataset.

    Attributes:
        name: Of the dataset, such as icub/jump/mine-v0.
        episodes: How many.
        seed: Of the first episode; the next ones count up.
    """

    name: tyro.conf.Positional[str]
    episodes: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count("episodes", self.episodes, 1)
        check_count("seed", self.seed, 0)


def export(arguments: Sequence[str]) -> None:
    """Run ``icub-jump export`` with these arguments."""
    kind, *words = arguments or ["--help"]
    if kind in ("-h", "--help"):
        print(USAGE)
        return
    guarded(lambda: _export(kind, words))


def _export(kind: str, words: Sequence[str]) -> None:
    if kind not in _WRITERS:
        raise InvalidValueError("export", kind, f"one of {', '.join(_WRITERS)}")
    sys.argv = [f"{sys.argv[0]} {kind}", *words]  # what the help says
    print(f"wrote {_WRITERS[kind](words)}", file=sys.stderr)


def _policy(words: Sequence[str]) -> Path:
    options = parse(PolicyOptions, words)
    from icub_jump_env.export.onnx_policy import write_onnx
    from icub_jump_env.policy import load_policy

    write_onnx(load_policy(options.policy), _checked(options.file, ".onnx"))
    return options.file


def _plan(words: Sequence[str]) -> Path:
    options = parse_entry(PlanOptions, words, file=tyro.MISSING)
    from icub_jump_env.evaluation.episodes.rollout import planned
    from icub_jump_env.export.tables import write_plan

    config, file = options.config, _checked(options.file, ".csv")
    write_plan(planned(config), config.robot_value, config.controller_config.frequency, file)
    return file


def _jump(words: Sequence[str]) -> Path:
    options = parse_entry(JumpOptions, words, file=tyro.MISSING)
    from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
    from icub_jump_env.export.tables import write_jump

    file, policy = _checked(options.file, ".csv"), options.contender().policy
    config = traced(options.config)
    hold = round(config.agent_frequency / options.config.agent_frequency)
    env = make_env(config)
    episode = run_episode(env, options.seed, policy, trace=True, hold=hold)
    write_jump(episode.trace, env.robot, file)
    return file


def _dataset(words: Sequence[str]) -> Path:
    options = parse_entry(DatasetOptions, words, name=tyro.MISSING)
    from icub_jump_env.export.dataset import write_dataset

    contender = options.contender()
    seeds = range(options.seed, options.seed + options.episodes)
    return write_dataset(options.name, options.config, contender.policy, seeds, contender.name)


def _checked(file: Path, suffix: str) -> Path:
    """Refuse a file that cannot be written, or would be called something else."""
    from icub_jump_env.evaluation.report.output import check_writable

    if file.suffix != suffix:
        raise ConfigError("file", str(file), f"a file whose name ends with {suffix}")
    check_writable("file", file)
    return file


_WRITERS: dict[str, Callable[[Sequence[str]], Path]] = {
    "policy": _policy,
    "plan": _plan,
    "jump": _jump,
    "dataset": _dataset,
}
