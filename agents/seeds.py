"""Which episodes are for what: nothing is judged on episodes that chose it.

Trainings draw their seeds from 32 bits, which leaves these out but for a chance of one in
a hundred thousand.
"""

TUNING = range(200)
"""Tuned the controllers; choose constants, mean actions and the strongest baselines."""

TEST = range(2000, 2500)
"""Reported. Nothing is chosen on them."""

SELECTION = range(10_000, 10_064)
"""The evaluations of a training, which choose its best policy."""
