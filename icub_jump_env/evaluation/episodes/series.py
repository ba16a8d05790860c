"""A series of episodes, logged as they come."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.cluster import Jobs
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.parallel import Job, run_jobs
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import commands
from icub_jump_env.evaluation.report.output import progress_display, say
from icub_jump_env.evaluation.report.provenance import (
    own_controller,
    plans,
    provenance,
    source,
    versions,
)
from icub_jump_env.files import strict_json
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.simulation.sensor_models import SensorConfig

RESUME = "add --resume to the command to finish"


@dataclass(frozen=True)
class Series:
    """Episodes of one contender.

    Attributes:
        config: The jump.
        seeds: Their seeds, one after the other.
        contender: What acts.
    """

    config: JumpConfig
    seeds: range
    contender: Contender = BASELINE

    def run(
        self,
        path: Path,
        resume: bool,
        jobs: Jobs,
        progress: Console,
        remedy: str = RESUME,
    ) -> list[Episode]:
        """Run the episodes that the log lacks.

        Args:
            path: The log.
            resume: Whether to go on with an existing log.
            jobs: Number of worker processes, or a cluster.
            progress: Where the progress is shown.
            remedy: What to say of an interrupted one.

        Returns:
            All episodes, by seed.

        Raises:
            ConfigError: If the existing log answers another question.
        """
        log = self.open_log(path, resume)
        (episodes,) = fill([(self, log)], jobs, progress, remedy)
        say(progress, f"wrote {path}")
        return episodes

    def open_log(self, path: Path, resume: bool) -> EpisodeLog:
        """The log at ``path``, as :class:`EpisodeLog` opens it.

        Raises:
            ConfigError: If the existing log answers another question.
        """
        header = {
            "episodes": len(self.seeds),
            "policy": self.contender.identity,
            **provenance(self.config, self.seeds.start),
        }
        return EpisodeLog(path, header, resume)

    def complete(self, jobs: Jobs, progress: Console) -> list[Episode]:
        """All episodes; those that the default log has are not run again."""
        log = self.default_log()
        return self.run(log, log.exists(), jobs, progress, "the same command goes on there")

    def default_log(self) -> Path:
        """Where the log goes: readable, and another file for another series."""
        asked = strict_json(
            [
                dataclasses.asdict(self.config),
                self.seeds.start,
                len(self.seeds),
                self.contender.identity,
                source(),
                plans(self.config),
                own_controller(self.config),
                versions(),
            ]
        )
        digest = hashlib.sha256(asked.encode()).hexdigest()[:8]
        height = commands(*self.config.jump_heights).replace(" ", "")
        words = (
            self.config.controller_name,
            self.contender.name,
            height,
            world(self.config),
            digest,
        )
        return Path("results") / f"{'-'.join(words)}.jsonl"


def fill(
    logs: Sequence[tuple[Series, EpisodeLog]], jobs: Jobs, progress: Console, remedy: str = RESUME
) -> list[list[Episode]]:
    """Run the episodes that the logs of some series lack, all side by side.

    Args:
        logs: Each series with its log.
        jobs: Number of worker processes, or a cluster.
        progress: Where the progress is shown.
        remedy: What to say of an interrupted run.

    Returns:
        All episodes of each series, by seed.
    """
    first = logs[0][1].path
    place = str(first) if len(logs) == 1 else f"{len(logs)} logs in {first.parent}"
    kept = [log.kept for _, log in logs if log.kept is not None]
    if kept:
        where = kept[0] if len(kept) == 1 else f"{len(kept)} logs beside the new ones"
        say(progress, f"kept the earlier episodes in {where}")
    damaged = sum(log.damaged for _, log in logs)
    if damaged:
        lines = "1 damaged line" if damaged == 1 else f"{damaged} damaged lines"
        say(progress, f"dropped {lines} of {place}: what is missing is jumped again")
    missing = [
        (log, Job(series.config, seed, series.contender.policy))
        for series, log in logs
        for seed in series.seeds
        if seed not in log.episodes
    ]
    total = sum(len(series.seeds) for series, _ in logs)
    names = ", ".join(dict.fromkeys(series.contender.name for series, _ in logs))
    with progress_display(progress) as display:
        task = display.add_task(
            f"jumping, {escape(names)}", total=total, completed=total - len(missing)
        )
        try:
            with contextlib.closing(run_jobs([job for _, job in missing], jobs)) as results:
                for index, episode in results:
                    missing[index][0].append(episode)
                    display.advance(task)
        except BaseException:
            done = sum(len(log.episodes) for _, log in logs)
            say(progress, f"{done} of {total} episodes are in {place}; {remedy}")
            raise
    for _, log in logs:
        log.finish()
    return [[log.episodes[seed] for seed in series.seeds] for series, log in logs]


def world(config: JumpConfig) -> str:
    """The randomisation, for titles."""
    return config.randomization if isinstance(config.randomization, str) else "custom"


def varies(config: JumpConfig) -> bool:
    """Whether anything differs between the episodes of a configuration."""
    low, high = config.jump_heights
    drawn = config.randomization_config.varies or low < high
    return drawn or config.sensor_config != SensorConfig()


def perturbed(config: JumpConfig) -> JumpConfig:
    """The same jump, with link masses that differ a little from episode to episode."""
    return dataclasses.replace(config, randomization=Randomization(link_mass=(0.999, 1.001)))


def warn_if_alike(config: JumpConfig, progress: Console) -> None:
    """Say so where nothing differs between episodes."""
    if not varies(config):
        say(progress, "nothing is random here: all episodes will be alike")
