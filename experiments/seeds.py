"""Which episodes are for what: nothing is judged on episodes that it was chosen on."""

from collections.abc import Mapping
from types import MappingProxyType

from agents.options import SELECTION
from icub_jump_env.control.config import ControllerName

__all__ = [
    "ENGINE",
    "FELT_TEST",
    "FELT_TUNING",
    "FORESIGHT_TEST",
    "LANDING_TEST",
    "PLANNER_TEST",
    "REACTING_TEST",
    "SELECTION",
    "TEST",
    "TUNING",
]

TUNING = range(200)
"""Tuned the controllers; choose constants, mean actions and the strongest baselines.

The next 30 judge the estimators.
"""

TEST = range(4000, 4500)
"""Held out: reported, and nothing is chosen on them.

Seeds 2000 to 2499 were the test seeds before. Their results had been seen when a rule of
:mod:`experiments.frontier` was changed, so they are held out no longer.
"""

FELT_TEST = range(7000, 7500)
"""Held out from everything that chose the policies of ``disturbed`` worlds, and what they meet."""

REACTING_TEST = range(7500, 8000)
"""Held out likewise, for a comparison that was added after :data:`FELT_TEST` had been jumped."""

FELT_TUNING = range(11_000, 11_400)
"""Chose how the policies of ``disturbed`` worlds learn."""

ENGINE = range(13_000, 13_200)
"""Jumped in two simulators."""

PLANNER_TEST = range(5000, 5200)
"""Held out from everything that chose whole-body plans."""

LANDING_TEST: Mapping[ControllerName, range] = MappingProxyType(
    {"velocity": range(8000, 8200), "torque": range(5600, 5800)}
)
"""Held out from everything that chose estimator, flight and landing.

The velocity controller was changed after both had been judged on the seeds of the torque controller,
of which no bit changed.
"""

# Others were jumped for tables and demonstrations: 1000 to 1199 (robots and worlds), 5900 to 5929 and 6000 to 6829
# (landing), 12000 to 12499 (policies). Seeds from 20000 to 20999 are the jump benchmark's:
# icub_jump_env/benchmark/cases.py.

FORESIGHT_TEST = range(5425, 5550)
"""Held out from everything that chose when an episode may end early.

Seeds 5300 to 5424 judged an earlier rule, of which 12 verdicts in 1000 were wrong; the present one was
chosen on them and on the tuning seeds.
"""
