"""Which episodes are for what: nothing is judged on episodes that it was chosen on."""

from agents.options import SELECTION

__all__ = ["LANDING_TEST", "PLANNER_TEST", "SELECTION", "TEST", "TUNING"]

TUNING = range(200)
"""Tuned the controllers; choose constants, mean actions and the strongest baselines."""

TEST = range(4000, 4500)
"""Held out: reported, and nothing is chosen on them.

Seeds 2000 to 2499 were the test seeds before. Their results had been seen when a rule of
:mod:`experiments.frontier` was changed, so they are held out no longer; the results in the cards
of the shipped policies, which were chosen earlier, are of those seeds.
"""

PLANNER_TEST = range(5000, 5200)
"""Held out from everything that chose whole-body plans."""

LANDING_TEST = range(5600, 5800)
"""Held out from everything that chose estimator, flight and landing."""
