"""What rise a controller makes of each plan of a family, in the nominal simulation."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import PlanningError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.episodes.series import perturbed
from icub_jump_env.planning.whole_body.family import ARRAYS, PlanFamily

REPETITIONS = 3
"""Jumps with each plan, link masses within 0.1 %; seeds from 0, which are for tuning."""


def calibrate(family: PlanFamily) -> PlanFamily:
    """The family whose rises are medians of jumps instead of plans.

    Plans with which a jump falls are left out; so are those of a branch that rise no higher than
    a lower plan of it, and branches of which fewer than two plans are left.

    Raises:
        PlanningError: If no branch is left.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "family.npz"
        family.save(path)
        config = JumpConfig.of(
            robot=family.card["robot"],
            controller=family.card["controller"],
            planner="whole_body",
            plans=path,
            stand_time=1.0,
        )
        measured = []
        for planned in family.rise:
            env = make_env(perturbed(config.replace(jump_height=float(planned))))
            episodes = [run_episode(env, seed) for seed in range(REPETITIONS)]
            landed = all(episode.landed for episode in episodes)
            rises = [episode.jump["flight_height"] for episode in episodes]
            measured.append(float(np.median(rises)) if landed else np.nan)
    rise = np.array(measured)
    kept = np.isfinite(rise)
    for branch in np.unique(family.branch):
        best = -np.inf
        for index in np.flatnonzero(family.branch == branch):
            kept[index] &= rise[index] > best
            best = max(best, rise[index]) if kept[index] else best
        if kept[family.branch == branch].sum() < 2:
            kept[family.branch == branch] = False
    if not kept.any():
        raise PlanningError("no branch has two plans that land")
    plans = [
        {**plan, "rise": round(float(value), 6)}
        for plan, value, keep in zip(family.card["plans"], rise, kept, strict=True)
        if keep
    ]
    arrays = {name: getattr(family, name)[kept] for name in ARRAYS if name != "rise"}
    return PlanFamily(rise=rise[kept], **arrays, card={**family.card, "plans": plans})
