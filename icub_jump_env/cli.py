"""The command ``icub-jump``: what the scripts of a checkout do, and more."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence

_USAGE = """\
icub-jump eval ...     evaluate the jump; icub-jump eval --help
icub-jump view ...     show it live: the same options
icub-jump train ...    train a residual on the reference; icub-jump train --help
icub-jump plan ...     make whole-body plans; icub-jump plan --help
icub-jump bench ...    the jump benchmark; icub-jump bench --help
icub-jump export ...   policies, plans and jumps for other programs; icub-jump export --help
icub-jump --version    versions of all that a jump depends on\
"""


def _eval(arguments: Sequence[str]) -> None:
    from icub_jump_env.evaluation.cli import evaluate

    evaluate(arguments)


def _view(arguments: Sequence[str]) -> None:
    _eval([*arguments, "--view"])


def _train(arguments: Sequence[str]) -> None:
    # In the wheel the agents are in the package; a checkout has them beside it.
    installed = importlib.util.find_spec("icub_jump_env.agents")
    package = "agents" if installed is None else "icub_jump_env.agents"
    importlib.import_module(f"{package}.cli").run(arguments)


def _plan(arguments: Sequence[str]) -> None:
    from icub_jump_env.planning.__main__ import run

    run(arguments)


def _export(arguments: Sequence[str]) -> None:
    from icub_jump_env.export.cli import export

    export(arguments)


def _bench(arguments: Sequence[str]) -> None:
    from icub_jump_env.benchmark.cli import bench

    bench(arguments)


_COMMANDS: dict[str, Callable[[Sequence[str]], None]] = {
    "eval": _eval,
    "view": _view,
    "train": _train,
    "plan": _plan,
    "bench": _bench,
    "export": _export,
}


def main() -> None:
    """Run one of the commands with the words of the command line."""
    name, *arguments = sys.argv[1:] or ["--help"]
    if name in ("-h", "--help"):
        print(_USAGE)
        return
    if name == "--version":
        from icub_jump_env.evaluation.report.provenance import versions

        print(*(f"{package} {version}" for package, version in versions().items()), sep="\n")
        return
    if name not in _COMMANDS:
        print(f"error: {name!r} is none of {', '.join(_COMMANDS)}", file=sys.stderr)
        sys.exit(2)
    sys.argv = [f"icub-jump {name}", *arguments]  # what help and results say
    try:
        _COMMANDS[name](arguments)
    except KeyboardInterrupt:  # while Python still imports
        sys.exit(130)
