"""What is tried against this project, and how often.

python tests/faults/count.py             # hours; an interrupted run goes on
python tests/faults/count.py --quick     # what the test suite does, minutes
"""

import argparse
import contextlib
import functools
import io
import json
import sys
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from rich.console import Console

from icub_jump_env.evaluation.report.output import new_table, show


class Count:
    """Counts the cases of each test, and writes a line for each that ends.

    Attributes:
        ended: What was told of each test, by its name.
    """

    def __init__(self, file):
        self._file, self._cases = file, Counter()
        lines = file.read_text().splitlines() if file.exists() else []
        entries = map(json.loads, lines)
        self.ended = {entry["test"]: entry for entry in entries if not entry["failed"]}

    def pytest_collection_modifyitems(self, items):
        from hypothesis import is_hypothesis_test  # pytest wants to be first

        items[:] = [item for item in items if item.nodeid not in self.ended]
        # A test with parameters is several items.
        for function in {item.function for item in items if is_hypothesis_test(item.obj)}:
            handle = function.hypothesis
            handle.inner_test = self._counted(handle.inner_test, function)

    def _counted(self, test, function):
        """A test that counts its examples, without those that it rejects."""

        @functools.wraps(test)
        def counted(*arguments, **keywords):
            test(*arguments, **keywords)
            self._cases[function] += 1

        return counted

    def pytest_runtest_protocol(self, item):
        self._present = {
            "test": item.nodeid, "fault": item.get_closest_marker("fault").args[0],
            "cases": 0, "failed": False, "skipped": False,
        }  # fmt: skip

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        present = self._present
        if report.when == "call" and not report.skipped:
            told = dict(report.user_properties).get("cases", 1)
            example = hasattr(item.obj, "hypothesis")
            present["cases"] = self._cases.pop(item.function, 0) if example else told
        present["failed"] |= report.failed
        present["skipped"] |= report.skipped
        if report.when == "teardown":
            self.ended[item.nodeid] = present
            with self._file.open("a") as file:
                print(json.dumps(present), file=file)
        return report


def table_of(ended):
    """A line for each fault."""
    by_fault = defaultdict(list)
    for entry in ended:
        by_fault[entry["fault"]].append(entry)
    table = new_table(1, "fault", "tests", "cases", "failed", "skipped")
    for fault, entries in sorted(by_fault.items()):
        sums = [sum(e[name] for e in entries) for name in ("cases", "failed", "skipped")]
        table.add_row(fault, *(f"{n:,}" for n in (len(entries) - sums[-1], *sums)))
    return table


def main():
    """Run the tests that have a fault, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    file = Path("results") / f"faults{'-quick' if quick else ''}.jsonl"
    file.parent.mkdir(exist_ok=True)
    if quick:
        file.unlink(missing_ok=True)
    elif file.exists():
        print(f"going on with {file}; without it, all is tried again", file=sys.stderr)
    count, printed = Count(file), io.StringIO()
    words = [str(Path(__file__).parents[1]), "-m", "fault", "-q", *([] if quick else ["--full"])]
    with contextlib.redirect_stdout(printed):
        code = pytest.main(words, plugins=[count])
    show(Console(), table_of(count.ended.values()))
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        print(printed.getvalue(), file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
