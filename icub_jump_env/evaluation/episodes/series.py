"""A series of episodes, logged as they come."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.parallel import Job, run_jobs
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.quantities import commands
from icub_jump_env.evaluation.report.output import progress_display, say
from icub_jump_env.evaluation.report.provenance import plans, provenance, source, versions
from icub_jump_env.files import strict_json
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.simulation.sensor_models import SensorConfig


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
        jobs: int,
        progress: Console,
        remedy: str = "add --resume to the command to finish",
    ) -> list[Episode]:
        """Run the episodes that the log lacks.

        Args:
            path: The log.
            resume: Whether to go on with an existing log.
            jobs: Number of worker processes.
            progress: Where the progress is shown.
            remedy: What to say of an interrupted one.

        Returns:
            All episodes, by seed.

        Raises:
            ConfigError: If the existing log answers another question.
        """
        total = len(self.seeds)
        header = {
            "episodes": total,
            "policy": self.contender.identity,
            **provenance(self.config, self.seeds.start),
        }
        log = EpisodeLog(path, header, resume)
        if log.kept is not None:
            say(progress, f"kept the earlier episodes in {log.kept}")
        if log.damaged:
            lines = "1 damaged line" if log.damaged == 1 else f"{log.damaged} damaged lines"
            say(progress, f"dropped {lines} of {log.path}: what is missing is jumped again")
        missing = [seed for seed in self.seeds if seed not in log.episodes]
        work = [Job(self.config, seed, self.contender.policy) for seed in missing]
        with progress_display(progress) as display:
            name = f"jumping, {escape(self.contender.name)}"
            task = display.add_task(name, total=total, completed=total - len(missing))
            try:
                with contextlib.closing(run_jobs(work, jobs)) as results:
                    for _, episode in results:
                        log.append(episode)
                        display.advance(task)
            except BaseException:
                kept = f"{len(log.episodes)} of {total} episodes are in {log.path}"
                say(progress, f"{kept}; {remedy}")
                raise
        log.finish()
        say(progress, f"wrote {log.path}")
        return [log.episodes[seed] for seed in self.seeds]

    def complete(self, jobs: int, progress: Console) -> list[Episode]:
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
