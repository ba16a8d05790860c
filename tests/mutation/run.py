"""How many random changes of the code the tests notice.

    pip install cosmic-ray
    python tests/mutation/run.py --jobs 2        # an interrupted run goes on

Cosmic Ray makes all mutants of the packages that decide what is measured and commanded: another
operator, comparison or number, a condition turned round, a line less. A random sample of them is tried.
The tests of a mutant's own package come first, the others if those notice nothing. What came of each
is kept in ``tried.jsonl``: with it, those are tried again whose place or line has changed, and those
that nothing noticed or explains, as there may be a test by now; without it, all.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import queue
import random
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from cosmic_ray.commands.init import _all_work_items
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from rich.console import Console

from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.evaluation.statistics.summary import Rate

REPOSITORY = Path(__file__).parents[2]
PACKAGES = ("control", "estimation", "metrics", "planning")
OTHERS = ("tests/simulation", *(f"tests/test_{name}.py" for name in (
    "recorded", "nominal", "env", "env_controllers", "env_episode_end", "env_determinism", "env_series", "residual_phases", "versions",
)))  # fmt: skip
"""Tests of what the packages do together."""
LONGEST = 900.0
"""Longest time (s) of the tests; a mutant that takes longer is noticed."""
ARITHMETIC = {"Add", "Sub", "Mul", "Div"}
"""Operators that replace one another; of numbers the others fail at once, or stand in annotations."""
EXPLAINED = Path(__file__).with_name("explained.toml")
TRIED = Path(__file__).with_name("tried.jsonl")


class Mutant(NamedTuple):
    """One change of the code.

    Attributes:
        package: Of which of :data:`PACKAGES`.
        module: Its file.
        operator: What is changed, in Cosmic Ray's words.
        occurrence: At which place.
        before, after: The lines that differ.
    """

    package: str
    module: str
    operator: str
    occurrence: int
    before: str
    after: str

    @property
    def change(self) -> tuple[str, str, str]:
        """Module, line and changed line."""
        return self.module, self.before, self.after


def all_of(package: str) -> Iterator[tuple[str, str, int]]:
    """Module, operator and occurrence of all mutants."""
    modules = sorted((REPOSITORY / "icub_jump_env" / package).rglob("*.py"))
    for item in _all_work_items(modules, {}):
        (mutation,) = item.mutations
        kind, *operators = mutation.operator_name.split("/")[1].split("_")
        if kind != "ReplaceBinaryOperator" or ARITHMETIC.issuperset(operators):
            module = str(Path(mutation.module_path).relative_to(REPOSITORY))
            yield module, mutation.operator_name, mutation.occurrence


def mutated(module: str, operator: str, occurrence: int) -> str:
    """The code of a mutant."""
    code = (REPOSITORY / module).read_text()
    found: str | None = mutate_code(code, get_operator(operator)(), occurrence)
    assert found is not None
    return found


def drawn(package: str, count: int) -> list[Mutant]:
    """A random sample, the same each time."""
    everything = list(all_of(package))
    sample = random.Random(package).sample(everything, min(count, len(everything)))
    mutants = []
    for module, operator, occurrence in sample:
        lines = (REPOSITORY / module).read_text().splitlines()
        others = mutated(module, operator, occurrence).splitlines()
        first = next(
            i for i, pair in enumerate(zip(lines, others, strict=False)) if len(set(pair)) > 1
        )
        before, after = lines[first].strip(), others[first].strip()
        mutants.append(Mutant(package, module, operator, occurrence, before, after))
    return mutants


def passes(tests: Sequence[str], copy: Path) -> bool:
    """Whether all of these tests pass in a copy of the repository."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    paths = {"PYTHONPATH": str(copy), "NUMBA_CACHE_DIR": str(copy / "compiled")}
    checked = {"NUMBA_BOUNDSCHECK": "1"}  # what is written beside an array would go unnoticed
    try:
        ran = subprocess.run(
            words, cwd=copy, env=os.environ | paths | checked, timeout=LONGEST, capture_output=True
        )
    except subprocess.TimeoutExpired:
        return False
    return ran.returncode == 0


def tests_of(mutant: Mutant, copy: Path) -> list[str]:
    """Files of tests of a mutant's package; first those that name its module, the shorter before."""
    name = ".".join(Path(mutant.module).with_suffix("").parts)
    files = sorted((copy / "tests" / mutant.package).glob("test_*.py"))
    code = {file: file.read_text() for file in files}
    files.sort(key=lambda file: (name not in code[file], len(code[file])))
    return [str(file.relative_to(copy)) for file in files]


def is_noticed(mutant: Mutant, copy: Path) -> bool:
    """Whether a test fails in a copy of the repository with a mutant."""
    file = copy / mutant.module
    code = file.read_text()
    file.write_text(mutated(mutant.module, mutant.operator, mutant.occurrence))
    try:
        return not (passes(tests_of(mutant, copy), copy) and passes(OTHERS, copy))
    finally:
        file.write_text(code)


def copies(folder: Path, count: int) -> queue.SimpleQueue[Path]:
    """Copies of what is committed, each to be changed by one at a time."""
    found: queue.SimpleQueue[Path] = queue.SimpleQueue()
    for number in range(count):
        copy = folder / str(number)
        subprocess.run(["git", "clone", "-q", REPOSITORY, copy], check=True)
        found.put(copy)
    return found


def explained() -> dict[tuple[str, str, str], str]:
    """Why a mutant that no test notices is none: by module, line and changed line."""
    entries = tomllib.loads(EXPLAINED.read_text())["mutant"]
    return {(e["module"], e["before"], e["after"]): e["why"] for e in entries}


def tried() -> dict[Mutant, bool]:
    """Whether each mutant that was ever tried was noticed the last time."""
    noticed = {}
    for line in TRIED.read_text().splitlines() if TRIED.exists() else []:
        with contextlib.suppress(ValueError):  # half a line
            *mutant, was_noticed = json.loads(line)
            noticed[Mutant(*mutant)] = was_noticed
    return noticed


def try_all(mutants: Sequence[Mutant], jobs: int) -> None:
    """Try mutants, and keep what comes of each."""
    lines = (json.dumps([*mutant, was_noticed]) + "\n" for mutant, was_noticed in tried().items())
    TRIED.write_text("".join(lines))
    with (
        TemporaryDirectory() as folder,
        TRIED.open("a") as file,
        ThreadPoolExecutor(jobs) as pool,
    ):
        free = copies(Path(folder), jobs)
        copy = free.get()
        if not passes([*(f"tests/{package}" for package in PACKAGES), *OTHERS], copy):
            sys.exit("error: tests fail without any mutant")
        free.put(copy)

        def attempt(mutant: Mutant) -> None:
            copy = free.get()
            try:
                line = json.dumps([*mutant, is_noticed(mutant, copy)])
                print(line, file=file, flush=True)
            finally:
                free.put(copy)

        for _ in pool.map(attempt, mutants):
            pass


def main() -> None:
    """Try a sample of each package, and print what was noticed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--mutants", type=int, default=100, help="of each package")
    parser.add_argument(
        "--jobs", type=int, default=1, help="copies of the repository side by side"
    )
    options = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    samples = {package: drawn(package, options.mutants) for package in PACKAGES}
    everything = [mutant for sample in samples.values() for mutant in sample]
    why, before = explained(), tried()
    known = [m for m in before if before[m] or m.change in why]
    if todo := [m for m in everything if m not in known]:
        try_all(todo, options.jobs)
    noticed = tried()
    table = new_table(
        1, "package", "mutants", "tried", "noticed", "explained", "noticed or explained, %"
    )
    for package, sample in samples.items():
        seen = sum(noticed[m] for m in sample)
        equal = sum(m.change in why for m in sample if not noticed[m])
        rate = Rate(seen + equal, len(sample))
        low, high = rate.interval
        percent = f"{100 * rate.share:.0f} ({100 * low:.0f} to {100 * high:.0f})"
        count = f"{sum(1 for _ in all_of(package)):,}"
        table.add_row(package, count, str(len(sample)), str(seen), str(equal), percent)
    show(Console(), table)
    for m in everything:
        if not (noticed[m] or m.change in why):
            print(f"{m.module}\n  {m.before}\n  {m.after}")


if __name__ == "__main__":
    main()
