"""Run clients for real, each in a virtual environment with what it needs, and print what came of it.

    python examples/clients/run.py               # all of them
    python examples/clients/run.py skrl_ppo

What a client needs beside this package stands in its first lines, as inline metadata; versions are
those of constraints.txt where that has one and the client does not ask for another.
"""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[1]
ARGUMENTS = {"ppo": ("--steps", "4096")}
FILES = sorted([HERE.parent / "ppo.py", *HERE.glob("*.py")])
CLIENTS = {file.stem: file for file in FILES if file.name != "run.py"}

METADATA = re.compile(r"^# /// script\n((?:# .*\n)+)# ///$", re.MULTILINE)
NAME = re.compile(r"[\w.-]+")
VERSIONS = "import sys; from importlib.metadata import version; print(*map(version, sys.argv[1:]))"


class Outcome(NamedTuple):
    """What came of a client.

    Attributes:
        client: Its name.
        versions: Of what it needs.
        said: Its last line, or how it failed.
        failed: Whether it did.
    """

    client: str
    versions: str
    said: str
    failed: bool


def dependencies_of(file: Path) -> tuple[str, ...]:
    """What a client needs beside this package."""
    found = METADATA.search(file.read_text())
    if found is None:
        raise ValueError(f"{file} does not say what it needs")
    text = "\n".join(line.removeprefix("# ") for line in found[1].splitlines())
    return tuple(tomllib.loads(text)["dependencies"])


def install(folder: Path, needs: Sequence[str]) -> Path:
    """A virtual environment with this package and more; its Python."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / "bin" / "python"
    asked = {NAME.match(need)[0].lower() for need in needs if "==" in need}
    lines = (REPOSITORY / "constraints.txt").read_text().splitlines()
    constraints = folder / "constraints.txt"
    constraints.write_text(
        "\n".join(x for x in lines if x.partition("==")[0].lower() not in asked)
    )
    words = ["-m", "pip", "install", "-q", "-c", constraints, REPOSITORY, *needs]
    subprocess.run([python, *words], check=True)
    return python


def run(client: str, pythons: dict[tuple[str, ...], Path], home: Path) -> Outcome:
    """Run a client in a folder of its own, with a virtual environment that others may share."""
    file, folder = CLIENTS[client], home / client
    needs = dependencies_of(file)
    if needs not in pythons:
        try:
            pythons[needs] = install(home / f"venv{len(pythons)}", needs)
        except subprocess.CalledProcessError as error:
            return Outcome(client, "", f"not installed: pip ended with {error.returncode}", True)
    python = pythons[needs]
    names = sorted({NAME.match(need)[0] for need in (*needs, "gymnasium")})
    found = subprocess.run(
        [python, "-c", VERSIONS, *names], check=True, stdout=subprocess.PIPE, text=True
    )
    versions = ", ".join(map(" ".join, zip(names, found.stdout.split(), strict=True)))
    folder.mkdir()
    ran = subprocess.run(
        [python, file, *ARGUMENTS.get(client, ())], cwd=folder, capture_output=True, text=True
    )
    lines = (ran.stdout if ran.returncode == 0 else ran.stderr).strip().splitlines()
    failed = "" if ran.returncode == 0 else f"failed with {ran.returncode}: "
    return Outcome(client, versions, f"{failed}{lines[-1] if lines else ''}", bool(failed))


def main() -> None:
    """Run them, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("client", nargs="*", help=f"of {', '.join(CLIENTS)}; all without a name")
    chosen = parser.parse_args().client or list(CLIENTS)
    if unknown := [name for name in chosen if name not in CLIENTS]:
        parser.error(f"{', '.join(unknown)}: there is no client of that name")
    outcomes: list[Outcome] = []
    with TemporaryDirectory() as home:
        pythons: dict[tuple[str, ...], Path] = {}
        for client in chosen:
            outcomes.append(run(client, pythons, Path(home)))
            print(f"{client}: {outcomes[-1].said}", file=sys.stderr)
    print("| client | with | it says | on |\n|---|---|---|---|")
    for outcome in outcomes:
        file = CLIENTS[outcome.client].relative_to(REPOSITORY)
        print(
            f"| [{outcome.client}](../{file}) | {outcome.versions} | {outcome.said} | {datetime.date.today()} |"
        )
    if any(outcome.failed for outcome in outcomes):
        sys.exit(1)


if __name__ == "__main__":
    main()
