"""Which episodes are for what: nothing is judged on episodes that chose it."""

from agents.options import SELECTION

__all__ = ["SELECTION", "TEST", "TUNING"]

TUNING = range(200)
"""Tuned the controllers; choose constants, mean actions and the strongest baselines."""

TEST = range(2000, 2500)
"""Reported. Nothing is chosen on them."""
