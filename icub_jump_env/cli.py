"""The command ``icub-jump``: what ``eval.py`` and ``train.py`` are in a checkout."""

from __future__ import annotations

import importlib
import importlib.util
import sys

_USAGE = """\
icub-jump eval ...     evaluate the jump; icub-jump eval --help
icub-jump train ...    train a residual on the reference; icub-jump train --help\
"""


def main() -> None:
    """Run one of the commands with the words of the command line."""
    name, *arguments = sys.argv[1:] or ["--help"]
    try:
        match name:
            case "eval":
                from icub_jump_env.evaluation.cli import evaluate

                evaluate(arguments)
            case "train":
                # In the wheel the agents are in the package; a checkout has them beside it.
                installed = importlib.util.find_spec("icub_jump_env.agents")
                package = "agents" if installed is None else "icub_jump_env.agents"
                importlib.import_module(f"{package}.cli").run(arguments)
            case "-h" | "--help":
                print(_USAGE)
            case _:
                print(f"error: {name!r} is none of eval, train", file=sys.stderr)
                sys.exit(2)
    except KeyboardInterrupt:  # while Python still imports
        sys.exit(130)
