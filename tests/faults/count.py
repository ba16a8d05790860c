"""What is tried against this project, and how often.

python tests/faults/count.py             # hours
python tests/faults/count.py --quick     # what the test suite does, minutes
"""

import argparse
import contextlib
import functools
import io
import sys
from collections import Counter
from pathlib import Path

import pytest
from rich.console import Console

from icub_jump_env.evaluation.report.output import new_table, show


class Count:
    """Counts tests, cases and failures by fault."""

    def __init__(self):
        self.tests, self.cases = Counter(), Counter()
        self.failed, self.skipped = Counter(), Counter()

    def pytest_collection_modifyitems(self, items):
        from hypothesis import is_hypothesis_test  # pytest wants to be first

        for item in items:
            marker = item.get_closest_marker("fault")
            if marker is not None and is_hypothesis_test(item.obj):
                handle = item.obj.hypothesis
                handle.inner_test = self._counted(handle.inner_test, marker.args[0])

    def _counted(self, test, fault):
        """A test that counts its examples, without those that it rejects."""

        @functools.wraps(test)
        def counted(*arguments, **keywords):
            test(*arguments, **keywords)
            self.cases[fault] += 1

        return counted

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        fault = item.get_closest_marker("fault").args[0]
        if report.when == "call" and not report.skipped:
            self.tests[fault] += 1
            if not hasattr(item.obj, "hypothesis"):
                self.cases[fault] += dict(report.user_properties).get("cases", 1)
        self.failed[fault] += report.failed
        self.skipped[fault] += report.skipped
        return report


def main():
    """Run the tests that have a fault, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    count, printed = Count(), io.StringIO()
    words = [str(Path(__file__).parents[1]), "-m", "fault", "-q", *([] if quick else ["--full"])]
    with contextlib.redirect_stdout(printed):
        code = pytest.main(words, plugins=[count])
    table = new_table(1, "fault", "tests", "cases", "failed", "skipped")
    numbers = (count.tests, count.cases, count.failed, count.skipped)
    for fault in sorted(set().union(*numbers)):
        table.add_row(fault, *(f"{each[fault]:,}" for each in numbers))
    show(Console(), table)
    if code:
        print(printed.getvalue(), file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
