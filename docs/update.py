"""Run the commands named in the documents and put their output below them.

A block of a document starts with a comment that holds a command and ends with the
fenced block that shows its output:

    <!-- python eval.py -->
    (fenced block)

    python docs/update.py
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parent
REPOSITORY = DOCS.parent
BLOCK = re.compile(r"<!-- (python [^\n]*?) -->\n(```|\|)(.*?)(\n```|\n\n|\Z)", re.DOTALL)


def output_of(command: str) -> str:
    """What the command prints, run in the repository with one BLAS thread."""
    arguments = [sys.executable, *command.split()[1:]]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    result = subprocess.run(
        arguments, cwd=REPOSITORY, env=environment, check=True, capture_output=True, text=True
    )
    lines = [line.rstrip() for line in result.stdout.splitlines()]
    return "\n".join(lines).strip()


def updated(text: str) -> str:
    """The document with fresh output in every block."""

    def fresh(match: re.Match[str]) -> str:
        command, fence, _, end = match.groups()
        print(command)
        body = output_of(command)
        start = "```\n" if fence == "```" else ""
        return f"<!-- {command} -->\n{start}{body}{end}"

    return BLOCK.sub(fresh, text)


def main() -> None:
    """Update README.md and all documents."""
    for file in (REPOSITORY / "README.md", *sorted(DOCS.glob("*.md"))):
        file.write_text(updated(file.read_text()))


if __name__ == "__main__":
    main()
