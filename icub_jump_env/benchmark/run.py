"""Jump the benchmark."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console

from icub_jump_env.benchmark.cases import CASES, EPISODES, FIRST_SEED, FIXED
from icub_jump_env.benchmark.results import Result, Score
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.cluster import Jobs
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender
from icub_jump_env.evaluation.episodes.series import Series, fill
from icub_jump_env.evaluation.report.provenance import provenance
from icub_jump_env.robot.kinematics import FeetFixedKinematics


def jump(
    config: JumpConfig,
    name: str,
    contender: Contender = BASELINE,
    jobs: Jobs = 1,
    progress: Console | None = None,
) -> Result:
    """Jump all cases; an interrupted run goes on where it stopped.

    Args:
        config: The entry, but for what the benchmark sets.
        name: What tables call it.
        contender: What acts in it.
        jobs: Number of worker processes, or a cluster.
        progress: Where the progress is shown; nowhere if None.

    Raises:
        ConfigError: If the entry sets what is the benchmark's, or cannot jump one of the cases.
    """
    for field in FIXED:
        value, default = getattr(config, field), getattr(JumpConfig(), field)
        if value != default:
            raise ConfigError(field, value, "left to the benchmark")
    series = [
        Series(
            case.of(config),
            range(FIRST_SEED + k * EPISODES, FIRST_SEED + (k + 1) * EPISODES),
            contender,
        )
        for k, case in enumerate(CASES.values())
    ]
    logs = []
    for each in series:
        path = each.default_log()
        logs.append((each, each.open_log(path, path.exists())))
    done = fill(logs, jobs, progress or Console(quiet=True), "the same command goes on there")
    standing = standing_height(config)
    scores = {case: Score.of(jumps, standing) for case, jumps in zip(CASES, done, strict=True)}
    return Result(name, scores, _source(config, contender))


def _source(config: JumpConfig, contender: Contender) -> dict[str, Any]:
    """Where the result comes from; of the configuration what is the entry's own."""
    known = provenance(config, FIRST_SEED)
    own = {field: value for field, value in known["config"].items() if field not in FIXED}
    return known | {
        "config": own,
        "policy": contender.identity,
        "seed": [FIRST_SEED, FIRST_SEED + EPISODES * len(CASES) - 1],
    }


def standing_height(config: JumpConfig) -> float:
    """Height of the CoM (m) of the robot that stands upright, all joints at zero."""
    kinematics = FeetFixedKinematics(config.robot_value)
    kinematics.update(np.zeros(config.robot_value.n_joints))
    return float(kinematics.com[2])
