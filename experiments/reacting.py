"""Do the policies win by reacting? Each beside its own mean action, replayed on the same baseline.

    python -m experiments.reacting --controller velocity --jobs 2

In ``disturbed`` worlds, on episodes of its own. :mod:`experiments.arms` replays the mean action of the
best policy alone, and compares it with all of them.
"""

from __future__ import annotations

import sys

from rich.console import Console

from experiments.arms import LAW, MORE, OURS, Arm, ArmsOptions, asked_for_more, policies, render
from experiments.rivals import open_loop
from experiments.seeds import REACTING_TEST, TUNING
from experiments.shipped import best_of, judged_config
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.report.output import show


def compare(options: ArmsOptions) -> None:
    """Replay the policies, jump the held-out episodes, and print."""
    console, progress = Console(), Console(stderr=True)
    trained = policies(f"disturbed-{options.controller}")
    law = judged_config(best_of(trained))
    replays = [
        Contender(f"replay of {each.name}", open_loop(each.policy, law, progress, TUNING))
        for each in trained
    ]
    arms = [
        asked_for_more(arm, MORE[options.controller])
        for arm in (
            Arm(LAW, law),
            Arm("law and own mean action", law, replays),
            Arm(OURS, law, trained),
        )
    ]
    used = REACTING_TEST[: options.episodes]
    done = [arm.jumps(used, options.jobs, progress) for arm in arms]
    table = render(arms, done, used, own=True)
    table.title = f"{options.controller} controller, disturbed, v1, 4 to 6 cm"
    show(console, table)


if __name__ == "__main__":
    guarded(lambda: compare(parse(ArmsOptions, sys.argv[1:])))
