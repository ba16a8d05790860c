"""What is tried against this project, and how often.

python tests/faults/count.py             # hours
python tests/faults/count.py --quick     # what the test suite does, minutes
"""

import argparse
import contextlib
import io
import sys
from collections import Counter
from pathlib import Path

import pytest
from rich.console import Console

from icub_jump_env.evaluation.report.output import new_table, show


class Count:
    """Counts cases and failures by fault."""

    def __init__(self):
        self.tests, self.cases, self.failed, self.skipped = (
            Counter(),
            Counter(),
            Counter(),
            Counter(),
        )

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        fault = item.get_closest_marker("fault").args[0]
        if report.failed:
            self.failed[fault] += 1
        elif report.skipped:
            self.skipped[fault] += 1
        if report.when == "call" and not report.skipped:
            from hypothesis import is_hypothesis_test, settings  # pytest wants to be first

            cases = dict(report.user_properties).get("cases", 1)
            if is_hypothesis_test(item.function):
                cases = settings().max_examples
            self.tests[fault] += 1
            self.cases[fault] += cases
        return report


def main():
    """Run the tests that have a fault, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    count, printed = Count(), io.StringIO()
    words = [
        str(Path(__file__).parents[1]),
        "-m",
        "fault",
        "-q",
        "-p",
        "no:cacheprovider",
        *([] if quick else ["--full"]),
    ]
    with contextlib.redirect_stdout(printed):
        code = pytest.main(words, plugins=[count])
    table = new_table(1, "fault", "tests", "cases", "failed", "skipped")
    for fault in sorted(count.tests | count.skipped):
        numbers = (count.tests, count.cases, count.failed, count.skipped)
        table.add_row(fault, *(f"{each[fault]:,}" for each in numbers))
    show(Console(), table)
    if code:
        print(printed.getvalue(), file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
