"""What is tried against this project, and how often.

python tests/faults/count.py             # hours; an interrupted run goes on
python tests/faults/count.py --quick     # what the test suite does, minutes
python tests/faults/count.py --fault soak
"""

import argparse
import contextlib
import functools
import io
import json
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from rich.console import Console

from icub_jump_env.evaluation.report.output import new_table, show

REPOSITORY = Path(__file__).parents[2]


def code():
    """What is tried: the trees of the commit."""
    words = (
        "git",
        "rev-parse",
        *(f"HEAD:{name}" for name in ("icub_jump_env", "agents", "tests")),
    )
    found = subprocess.run(words, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    return found.stdout.split()


class Count:
    """Counts the cases of each test, and writes a line for each that ends.

    Attributes:
        entries: The lines, of this code and of the wanted fault alone.
        faults: All there are.
    """

    def __init__(self, file, fault):
        self._file, self._fault = file, fault
        self._code, self._cases = code(), Counter()
        kept = []
        for line in file.read_text().splitlines() if file.exists() else []:
            with contextlib.suppress(ValueError):  # half a line
                kept.append(json.loads(line))
        file.write_text("".join(json.dumps(entry) + "\n" for entry in kept))
        self.entries = [e for e in kept if e["code"] == self._code and fault in (None, e["fault"])]

    def pytest_collection_modifyitems(self, items):
        from hypothesis import is_hypothesis_test  # pytest wants to be first

        markers = (item.get_closest_marker("fault") for item in items)
        self.faults = {marker.args[0] for marker in markers if marker}
        done = {e["test"] for e in self.entries if not e["failed"] and not e["skipped"]}
        items[:] = [item for item in items if item.nodeid not in done and self._wants(item)]
        # A test with parameters is several items.
        for function in {item.function for item in items if is_hypothesis_test(item.obj)}:
            handle = function.hypothesis
            handle.inner_test = self._counted(handle.inner_test, function)

    def _wants(self, item):
        marker = item.get_closest_marker("fault")
        return marker is not None and self._fault in (None, *marker.args)

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
            "cases": 0, "failed": False, "skipped": False, "code": self._code,
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
            self.entries.append(present)
            with self._file.open("a") as file:
                print(json.dumps(present), file=file)
        return report


def table_of(entries):
    """A line for each fault. A test that failed once has failed, whatever came of it later."""
    by_fault = defaultdict(dict)
    failed = {entry["test"] for entry in entries if entry["failed"]}
    for entry in entries:
        by_fault[entry["fault"]][entry["test"]] = entry
    table = new_table(1, "fault", "tests", "cases", "failed", "skipped")
    for fault, last in sorted(by_fault.items()):
        cases = sum(entry["cases"] for entry in last.values())
        skipped = sum(entry["skipped"] for entry in last.values())
        numbers = (len(last) - skipped, cases, len(failed & last.keys()), skipped)
        table.add_row(fault, *(f"{number:,}" for number in numbers))
    return table


def main():
    """Run the tests that have a fault, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--fault", help="try this one alone")
    options = parser.parse_args()
    quick = options.quick
    file = Path("results") / f"faults{'-quick' if quick else ''}.jsonl"
    file.parent.mkdir(exist_ok=True)
    if quick:
        file.unlink(missing_ok=True)
    elif file.exists():
        print(f"going on with {file}; without it, all is tried again", file=sys.stderr)
    count, printed = Count(file, options.fault), io.StringIO()
    words = [str(REPOSITORY / "tests"), "-m", "fault", "-q"]
    if not quick:  # a test may take hours
        words += ["--full", "-o", "faulthandler_timeout=0"]
    with contextlib.redirect_stdout(printed):
        ended = pytest.main(words, plugins=[count])
    if options.fault not in (None, *count.faults):
        names = ", ".join(sorted(count.faults))
        sys.exit(f"error: fault={options.fault!r} is not allowed: expected one of {names}")
    show(Console(), table_of(count.entries))
    if ended != pytest.ExitCode.OK and not (
        count.entries and ended == pytest.ExitCode.NO_TESTS_COLLECTED
    ):
        print(printed.getvalue(), file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
