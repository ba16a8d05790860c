"""Run the commands named in the documents and put their output below them.

A block of a document is a line that holds a command alone, and the fenced block or table that shows its
output:

    `python eval.py`

    (fenced block)

    python docs/update.py
    python docs/update.py --only "--study robots"
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

DOCS = Path(__file__).parent
REPOSITORY = DOCS.parent
BLOCK = re.compile(
    r"^`(?P<command>python [^`\n]*)`\n\n"
    r"(?:(?P<fence>```)\n.*?(?<=\n)```\n|(?:\|[^\n]*\n)+)",
    re.DOTALL | re.MULTILINE,
)
"""A command and, below it, a fenced block or a table."""


def output_of(command: str) -> str:
    """What the command prints, run in the repository with one BLAS thread."""
    arguments = [sys.executable, *shlex.split(command)[1:]]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    result = subprocess.run(
        arguments, cwd=REPOSITORY, env=environment, check=False, stdout=subprocess.PIPE, text=True
    )
    if result.returncode != 0:
        sys.exit(f"failed: {command}")
    lines = [line.rstrip() for line in result.stdout.splitlines()]
    return "\n".join(lines).strip("\n")


def fresh(block: re.Match[str], output: Callable[[str], str] = output_of) -> str:
    """A block with fresh output."""
    command, fence = block["command"], block["fence"] or ""
    body = output(command)
    shown = f"{fence}\n{body}\n{fence}" if fence else body
    return f"`{command}`\n\n{shown}\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Update README.md and all documents, each block as soon as its command has run."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--only", default="", help="run the commands that contain these words")
    only = parser.parse_args(arguments).only
    for file in (REPOSITORY / "README.md", *sorted(DOCS.rglob("*.md"))):
        for block in BLOCK.finditer(file.read_text()):
            if only not in block["command"]:
                continue
            print(f"{file.relative_to(REPOSITORY)}: {block['command']}")
            file.write_text(file.read_text().replace(block[0], fresh(block)))


if __name__ == "__main__":
    main()
