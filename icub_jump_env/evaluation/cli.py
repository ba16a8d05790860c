"""Command line of eval.py."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import io
import json
import re
import signal
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, cast, get_args

import tyro
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ICubJumpError, one_line, shown
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.files import read_json
from icub_jump_env.simulation.opengl import import_mujoco
from icub_jump_env.versions import VERSIONS, EnvName

if TYPE_CHECKING:
    from icub_jump_env.policy.card import PolicyCard

T = TypeVar("T")

USAGE_ERROR = 2
INTERRUPTED = 130


_registry = tyro.constructors.ConstructorRegistry()


@_registry.primitive_rule
def _name_or_json(
    info: tyro.constructors.PrimitiveTypeInfo,
) -> tyro.constructors.PrimitiveConstructorSpec[Any] | None:
    """Models are given by name, or by their fields as JSON."""
    options = get_args(info.type)
    kinds = tuple(kind for kind in options if dataclasses.is_dataclass(kind))
    if not kinds or len(kinds) != len(options) - 1:
        return None
    names = get_args(options[0])

    def from_words(words: list[str]) -> Any:
        if words[0] in names:
            return words[0]
        try:
            return read_json(words[0])
        except ValueError as error:
            told = f"none of {', '.join(names)}, nor readable as JSON ({error})"
            raise ValueError(f"{shown(words[0])} is {told}") from None

    return tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar=f"{{{','.join(names)}}}|JSON",
        instance_from_str=from_words,
        is_instance=lambda value: isinstance(value, str) or dataclasses.is_dataclass(value),
        str_from_instance=lambda value: [
            value if isinstance(value, str) else json.dumps(dataclasses.asdict(value))
        ],
    )


def parse(kind: type[T], arguments: Sequence[str], default: T | None = None) -> T:
    """Parse a command line into ``kind``; on an error exit with one line.

    Args:
        kind: A dataclass.
        arguments: The words of the command line.
        default: What holds where they say nothing; else the defaults of ``kind``.

    Raises:
        ConfigError: If a value is out of range.
    """
    # What tyro prints it decorates for a terminal, if it sees one.
    page = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    try:
        with contextlib.redirect_stdout(page), contextlib.redirect_stderr(page):
            if default is None:
                return tyro.cli(kind, args=list(arguments), registry=_registry)
            return tyro.cli(kind, args=list(arguments), registry=_registry, default=default)
    except SystemExit as end:
        page.seek(0)
        if end.code in (0, None):
            print(*map(_without_markup, page.read().splitlines()), sep="\n")
            raise
        _fail(_one_line(page.read()))


def _without_markup(line: str) -> str:
    """A line of the help, which is made of docstrings, as wide as before."""
    plain = re.sub(r":\w+:(?=`)|`", "", line)
    if plain.endswith("│"):
        plain = f"{plain[:-1]}{' ' * (len(line) - len(plain))}│"
    return plain


def seek(arguments: Sequence[str], *flags: str) -> dict[str, list[str]]:
    """The words after some flags, found before the rest of a command line is parsed.

    For files that say what holds where the command line says nothing.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for flag in flags:
        parser.add_argument(f"--{flag}", nargs="+")
    try:
        found, _ = parser.parse_known_args(arguments)
    except argparse.ArgumentError:
        return {}  # who parses all of it finds better words
    return {flag: words for flag, words in vars(found).items() if words is not None}


def guarded(main: Callable[[], None]) -> None:
    """Run ``main``; any error that we foresee ends with one line and a non-zero exit."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        main()
    except (ICubJumpError, OSError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)


def evaluate(arguments: Sequence[str]) -> None:
    """Run eval.py with these arguments."""
    guarded(lambda: _evaluate(arguments))


def _evaluate(arguments: Sequence[str]) -> None:
    options = parse(EvalOptions, arguments, _defaults(arguments))
    import_mujoco()
    # Imported here, like the modes, so that --help and bad arguments answer at once.
    from icub_jump_env.evaluation.report.output import check_writable, say

    for name in ("json", "video", "results"):
        path = getattr(options, name)
        if path is not None:
            check_writable(name, path)
    if options.plot is not None:
        check_writable("plot", options.plot, folder=True)
    if options.video is not None:
        from icub_jump_env.evaluation.modes.video import check_video, record_video

        check_video(options.video)

    from icub_jump_env.evaluation.episodes.cluster import Cluster
    from icub_jump_env.evaluation.episodes.contender import check_contender, read_contenders

    words = options.compare or (options.policy or "baseline",)
    contenders = read_contenders([str(word) for word in words])
    for contender in contenders:
        check_contender(contender, options.config)
    if isinstance(options.workers, Cluster):
        options.workers.connect()  # before any file is touched
    console, progress = Console(), Console(stderr=True)
    mode = importlib.import_module(f"icub_jump_env.evaluation.modes.{options.mode}")
    mode.run(options, contenders, console, progress)
    if options.video is not None:
        policy = contenders[0].policy
        record_video(options.video, options.config, options.seed, progress, policy)
        say(progress, f"wrote {options.video}")


def default_config(arguments: Sequence[str]) -> JumpConfig:
    """The jump where a command line says nothing, if that is not the usual.

    The defaults of the environment that it names, and what its policy was trained for.
    """
    found = seek(arguments, "env", "policy")
    env = found.get("env", ["ICubJump-v0"])[0]
    config = JumpConfig.of(**VERSIONS.get(cast("EnvName", env), {}))
    card = _first_card(found.get("policy", ()))
    return config if card is None else card.as_trained(config)


def _defaults(arguments: Sequence[str]) -> EvalOptions:
    """Likewise of eval.py, which compares policies, too."""
    config, compared = default_config(arguments), seek(arguments, "compare").get("compare")
    card = _first_card(compared or ())
    if card is None:
        return EvalOptions(config=config)
    config = card.as_trained(config)
    # A range of commands is for this mode alone.
    config = dataclasses.replace(config, jump_height=card.config.jump_height)
    return EvalOptions(config=config, compare=tuple(compared or ()))


def _first_card(words: Sequence[str]) -> PolicyCard | None:
    """Of the policies that a command line names."""
    if not words:
        return None
    from icub_jump_env.evaluation.episodes.contender import read_contenders

    cards = (contender.card for contender in read_contenders(words))
    return next((card for card in cards if card is not None), None)


def _one_line(complaint: str) -> str:
    """The message inside tyro's box, without frame, title and advice but for similar flags."""
    lines = [line.strip("╭╮╰╯│─ ") for line in complaint.splitlines()]
    message = []
    for line in lines[1:]:
        if not line:
            break
        message.append(line)
    # tyro says so where a dataclass itself refused; the user knows no dataclass.
    text = re.sub(r"^Error parsing \w*Options: ", "", " ".join(message)) or "bad arguments"
    text = re.sub(r"^Missing from [^:]+: ", "missing: ", text)
    if text.startswith("Unrecognized options"):
        # Sorted: tyro has them in any order.
        similar = sorted(set(re.findall(r"^│ {5}(--[\w.-]+)", complaint, re.MULTILINE)))
        if similar:
            text += f"; did you mean {' or '.join(similar)}?"
    return text


def _fail(message: str) -> NoReturn:
    print(f"error: {one_line(message)}", file=sys.stderr)
    sys.exit(USAGE_ERROR)
