"""What eval.py can be asked for."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from icub_jump_env.checks import check_count, store
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.cluster import Cluster, Jobs
from icub_jump_env.shortcuts import Shortcuts
from icub_jump_env.versions import EnvName

STUDY_EPISODES = 20
"""Episodes of each case of a study."""
MOST_EPISODES = 1_000_000

_MODES = ("compare", "study", "sweep", "max_height", "report", "view")
_COMMON = ("env", "config", "shortcuts", "seed")
_USED = {
    "nominal": ("episodes", "policy", "json", "plot", "video"),
    "statistics": (
        "episodes",
        "policy",
        "jobs",
        "cluster",
        "results",
        "resume",
        "json",
        "plot",
        "video",
    ),
    "compare": ("episodes", "jobs", "cluster", "resume", "json", "plot"),
    "study": ("episodes", "jobs", "cluster", "json", "plot"),
    "landing_study": ("episodes", "jobs", "cluster", "resume", "json", "plot"),
    "sweep": ("jobs", "cluster", "json", "plot"),
    "max_height": ("jobs", "cluster", "json"),
    "report": (),
    "view": ("policy",),
}
"""Options that each mode uses, beside the common ones and its own."""

_CHOSEN_BY_MODE = {
    "study": ("controller",),
    "landing_study": (
        "controller", "estimator", "flight", "landing",
        "jump_height", "com_displacement", "planner", "randomization", "sensors",
    ),
    "sweep": ("controller", "jump_height", "com_displacement", "randomization"),
    "max_height": ("jump_height", "com_displacement", "randomization"),
    "report": ("controller",),
}  # fmt: skip
"""Fields of the configuration that a mode sets itself."""


@dataclass(frozen=True)
class EvalOptions:
    """Evaluate the jump.

    Without further options: the jump with and without the momentum constraint, beside
    the paper's numbers. With randomization or several episodes: success and landing
    rates, metrics and failures.

    Attributes:
        config: The jump; every field of the environment's configuration is a flag.
        shortcuts: Fields inside its groups; they end up there.
        env: Whose defaults hold: the paper's jump (v0), or the strongest settings (v1).
        episodes: Number of episodes; in a study, of each case (default 20).
        seed: Seed of the first episode; the next ones count up.
        policy: Let this policy act; the jump is set up as its card says.
        compare: Compare policies on the same episodes: files, and the word baseline.
        jobs: Processes that work in parallel.
        cluster: Let all processors of a Ray cluster do the work: HOST:PORT of its head (extra
            'cluster').
        study: What changes the jump: the realism of actuators and sensors, the task as cost or
            constraint, what ends the launch, the robot; how flight and landing are controlled,
            under disturbances of several sizes.
        sweep: Desired height against displacement, for both controllers.
        max_height: The highest whole-body plan, and the rise with the highest that stands, for both
            controllers, with what binds.
        report: Write one self-contained HTML page into this folder (extra 'video').
        view: Show the jump live, in the browser or in a window.
        results: Where an evaluation of several episodes keeps them as they come; by
            default a file in results/.
        resume: Finish an interrupted evaluation; without one, begin it.
        json: Write everything to this file.
        plot: Draw the figures into this folder.
        video: Record the jump to this file, such as jump.mp4 (extra 'video').

    Raises:
        ConfigError: If a value is out of range or options exclude each other.
    """

    config: Annotated[JumpConfig, tyro.conf.arg(name="")] = field(default_factory=JumpConfig)
    shortcuts: Annotated[Shortcuts, tyro.conf.arg(name="")] = field(default_factory=Shortcuts)
    env: EnvName = "ICubJump-v0"
    episodes: int | None = None
    seed: int = 0
    policy: Path | None = None
    compare: tuple[str, ...] | None = None
    jobs: int = 1
    cluster: str | None = None
    study: Literal["realism", "constraints", "launch_end", "robots", "landing"] | None = None
    sweep: bool = False
    max_height: bool = False
    report: Path | None = None
    view: bool = False
    results: Path | None = None
    resume: bool = False
    json: Path | None = None
    plot: Path | None = None
    video: Path | None = None

    def __post_init__(self) -> None:
        store(self, config=self.config.replace(**vars(self.shortcuts)), shortcuts=Shortcuts())
        if self.episodes is not None:
            check_count("episodes", self.episodes, 1, MOST_EPISODES)
        check_count("seed", self.seed, 0)
        check_count("jobs", self.jobs, 1, unit="processes")
        if isinstance(self.workers, Cluster) and self.jobs != 1:
            raise ConfigError(
                "jobs", self.jobs, "not with --cluster, all of whose processors work"
            )
        chosen = [mode for mode in _MODES if getattr(self, mode)]
        if len(chosen) > 1:
            raise ConfigError(chosen[0], getattr(self, chosen[0]), f"not with {_flag(chosen[1])}")
        if self.compare is not None and len(self.compare) < 2:
            raise ConfigError("compare", self.compare, "two or more policies")
        several_heights = isinstance(self.config.jump_height, tuple)
        if several_heights and self.mode not in ("statistics", "compare"):
            raise ConfigError(
                "jump_height", self.config.jump_height, f"one height with {_flag(self.mode)}"
            )
        if self.config.jumps > 1:
            if self.mode not in ("nominal", "statistics", "view"):
                raise ConfigError("jumps", self.config.jumps, f"1 with {_flag(self.mode)}")
            if self.plot is not None:
                raise ConfigError("jumps", self.config.jumps, "1 with --plot")
        outputs = [
            path.resolve()
            for name in ("json", "results", "plot", "video")
            if (path := getattr(self, name)) is not None
        ]
        if len(set(outputs)) < len(outputs):
            raise ConfigError("json", str(self.json), "another path for each output")
        used = (*_COMMON, *_USED[self.mode], *chosen)
        for option in dataclasses.fields(self):
            value = getattr(self, option.name)
            if option.name not in used and value != option.default:
                where = _flag(self.mode) if chosen else "a single jump that nothing randomises"
                shown = str(value) if isinstance(value, Path) else value
                raise ConfigError(option.name, shown, f"not with {where}")
        for name in _CHOSEN_BY_MODE.get(self.mode, ()):
            value = self.config.value_of(name)
            if value != JumpConfig().value_of(name):
                allowed = f"not with {_flag(self.mode)}, which varies it itself"
                raise ConfigError(name, value, allowed)

    @property
    def seeds(self) -> range:
        """Of the episodes."""
        return range(self.seed, self.seed + (self.episodes or 1))

    @property
    def workers(self) -> Jobs:
        """What runs the episodes."""
        return self.jobs if self.cluster is None else Cluster(self.cluster)

    @property
    def mode(self) -> str:
        """Which of eval.py's modes is meant."""
        if self.study == "landing":
            return "landing_study"
        for mode in _MODES:
            if getattr(self, mode):
                return mode
        several = self.episodes is not None and self.episodes > 1
        drawn = self.config.randomization_config.varies or isinstance(
            self.config.jump_height, tuple
        )
        return "statistics" if several or drawn else "nominal"


def _flag(mode: str) -> str:
    if mode == "landing_study":
        return "--study landing"
    return f"--{mode.replace('_', '-')}"
