"""Command line of ``icub-jump export``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from icub_jump_env.errors import InvalidValueError
from icub_jump_env.evaluation.cli import contenders_of, guarded, read_options

USAGE = """\
icub-jump export policy NAME FILE.onnx      a policy; FILE.json names its inputs and outputs
icub-jump export plan FILE.csv ...          the set points of a launch
icub-jump export jump FILE.csv ...          a jump at its control ticks
icub-jump export dataset NAME ...           episodes as a Minari dataset, named as in icub/jump-v0
... are options of icub-jump eval: --jump-height 0.05 --policy torque --episodes 10\
"""

_PLACES = {
    "policy": ("a policy", "a file"),
    "plan": ("a file",),
    "jump": ("a file",),
    "dataset": ("a name",),
}
"""What the first words of each say."""


def export(arguments: Sequence[str]) -> None:
    """Run ``icub-jump export`` with these arguments."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        return
    guarded(lambda: _export(*arguments))


def _export(kind: str, *words: str) -> None:
    if kind not in _PLACES:
        raise InvalidValueError("export", kind, f"one of {', '.join(_PLACES)}")
    places = _PLACES[kind]
    places_given, options = words[: len(places)], words[len(places) :]
    if len(places_given) < len(places) or any(word.startswith("-") for word in places_given):
        raise InvalidValueError(kind, " ".join(words), f"{' and '.join(places)} before options")
    print(f"wrote {_WRITERS[kind](*places_given, words=options)}", file=sys.stderr)


def _policy(name: str, file: str, *, words: Sequence[str]) -> Path:
    from icub_jump_env.export.onnx_policy import write_onnx
    from icub_jump_env.policy import load_policy

    if words:
        raise InvalidValueError("policy", words[0], "no options")
    write_onnx(load_policy(name), Path(file))
    return Path(file)


def _plan(file: str, *, words: Sequence[str]) -> Path:
    from icub_jump_env.evaluation.episodes.rollout import planned
    from icub_jump_env.export.tables import write_plan

    config = read_options(words).config
    frequency = config.controller_config.frequency
    write_plan(planned(config), config.robot_value, frequency, Path(file))
    return Path(file)


def _jump(file: str, *, words: Sequence[str]) -> Path:
    from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
    from icub_jump_env.export.tables import write_jump

    options = read_options(words)
    (contender,) = contenders_of(options)
    config = traced(options.config)
    hold = round(config.agent_frequency / options.config.agent_frequency)
    env = make_env(config)
    episode = run_episode(env, options.seed, contender.policy, trace=True, hold=hold)
    write_jump(episode.trace, env.robot, Path(file))
    return Path(file)


def _dataset(name: str, *, words: Sequence[str]) -> Path:
    from icub_jump_env.export.dataset import write_dataset

    options = read_options(words)
    (contender,) = contenders_of(options)
    return write_dataset(name, options.config, contender.policy, options.seeds, contender.name)


_WRITERS: dict[str, Callable[..., Path]] = {
    "policy": _policy,
    "plan": _plan,
    "jump": _jump,
    "dataset": _dataset,
}
