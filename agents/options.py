"""What train.py can be asked for."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import tyro

from icub_jump_env.checks import (
    check_choice,
    check_count,
    check_number,
    check_numbers,
    store,
)
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.cluster import Cluster
from icub_jump_env.files import read_json
from icub_jump_env.planning.residual import AxisName, check_axes
from icub_jump_env.policy.fields import (
    ACTION_SCALE_RANGE,
    check_hidden,
)
from icub_jump_env.shortcuts import Shortcuts

Inputs = Literal["all", "balance", "command"]
Critic = Literal["observation", "world"]

COMMAND_BLOCKS = (
    "phase",
    "launch_progress",
    "time",
    "jump_height",
    "com_displacement",
    "takeoff_time",
)
"""What is known before the jump: an agent that sees no more replays a plan."""

JOINT_BLOCKS = "joint_position", "joint_velocity"
"""Half of the observation, which an agent that balances can do without."""

TASK = JumpConfig(jump_height=(0.04, 0.08), com_displacement=0.09, randomization="hard")
"""A short launch jumps higher than the paper's 11 cm, and lands less often."""

SELECTION = range(10_000, 10_200)
"""Seeds of the evaluations of a training, which choose its best policy. Its own episodes draw
theirs from 32 bits, which leaves these out but for a chance of one in a hundred thousand."""

LARGEST_SEED = 2**32 - 1

_RANGE = re.compile(r"(\d{1,10})\.\.(\d{1,10})", re.ASCII)
"""The first and the last seed."""

OPTIONS = "options.json"
"""File in a run's folder that says what the run was asked for."""

COMMAND = "command"
"""Its field that holds the words of the command that began the run."""


@dataclass(frozen=True)
class PPOOptions:
    """How PPO learns.

    Attributes:
        episodes: Episodes between two updates, of all environments together.
        batch_size: Steps in one gradient step.
        epochs: Passes over the episodes in an update.
        learning_rate: Step size of Adam.
        gamma: Discount per step.
        gae_lambda: Trade of bias for variance in the advantages.
        clip_range: How far an update may change the probability of an action.
        target_kl: An update ends early beyond 1.5 times this divergence.
        hidden: Widths of the policy's hidden layers; with none it is a linear feedback.
        critic_hidden: Those of the value function.
        log_std: Logarithm of the exploration noise, at the beginning and at the end: of what an
            episode adds to its actions throughout.
        warmup: Updates at the beginning that teach the value function alone.
        action_scale: Largest action of the policy.
        ramp: Updates during which the actions grow to their scale.
    """

    episodes: int = 64
    batch_size: int = 256
    epochs: int = 10
    learning_rate: float = 5e-4
    gamma: float = 0.999
    gae_lambda: float = 0.98
    clip_range: float = 0.2
    target_kl: float = 0.04
    hidden: tuple[int, ...] = (64, 64)
    critic_hidden: tuple[int, ...] = (64, 64)
    log_std: tuple[float, float] = (-1.0, -2.3)
    warmup: int = 1
    action_scale: float = 1.0
    ramp: int = 0

    def __post_init__(self) -> None:
        for name, least, unit in (
            ("episodes", 2, ""),
            ("batch_size", 2, "steps"),
            ("epochs", 1, ""),
            ("warmup", 0, "updates"),
            ("ramp", 0, "updates"),
        ):
            check_count(name, getattr(self, name), least, 100_000, unit)
        for name, low, high, unit in (
            ("learning_rate", 1e-8, 1.0, ""),
            ("gamma", 0.0, 1.0, "per step"),
            ("gae_lambda", 0.0, 1.0, "per step"),
            ("clip_range", 1e-3, 1.0, ""),
            ("target_kl", 1e-6, 10.0, ""),
            ("action_scale", *ACTION_SCALE_RANGE, "of the largest action"),
        ):
            store(self, **{name: check_number(name, getattr(self, name), low, high, unit)})
        store(self, hidden=check_hidden(self.hidden))
        store(self, critic_hidden=check_hidden(self.critic_hidden))
        store(self, log_std=check_numbers("log_std", self.log_std, 2, -10.0, 2.0))


@dataclass(frozen=True)
class TrainOptions:
    """Train a residual on the CoM reference with PPO.

    Attributes:
        env: The jump; every field of the environment's configuration is a flag.
        shortcuts: Fields inside its groups; they end up there.
        ppo: How PPO learns.
        inputs: What the policy sees: the whole observation, all but the joints, or command and
            time alone.
        axes: Axes of the action that it uses; by default forward and vertical, as far as the action
            has them, else all that it has.
        critic: What the value function sees in training: the same, or the world and the true state,
            too.
        timesteps: Steps of the launch to learn from; an episode has 30 to 50.
        seed: Seed of everything random.
        seeds: Train with each of these seeds instead, such as 0..4, each in a folder of its own.
            The same command goes on with what was interrupted.
        cluster: Train on a Ray cluster, the seeds side by side: HOST:PORT of its head (extra
            'cluster').
        jobs: Environments side by side, each in a process; the result depends on it.
        checkpoint_every: Updates between two checkpoints; with each the policy is
            evaluated.
        evaluation_episodes: Episodes of each evaluation, which choose the best policy.
        run: Folder of the run; by default one in runs/, named by controller and seed.
        resume: Finish the interrupted run in this folder.
        config: Take what is not said here from this file, such as a run's options.json.

    Raises:
        ConfigError: If a value is out of range or options exclude each other.
    """

    env: Annotated[JumpConfig, tyro.conf.arg(name="")] = TASK
    shortcuts: Annotated[Shortcuts, tyro.conf.arg(name="")] = field(default_factory=Shortcuts)
    ppo: PPOOptions = field(default_factory=PPOOptions)
    inputs: Inputs = "all"
    axes: tuple[AxisName, ...] = ()
    critic: Critic = "observation"
    timesteps: int = 150_000
    seed: int = 0
    seeds: str | None = None
    cluster: str | None = None
    jobs: int = 8
    checkpoint_every: int = 12
    evaluation_episodes: int = len(SELECTION)
    run: Path | None = None
    resume: Path | None = None
    config: Path | None = None

    def __post_init__(self) -> None:
        store(self, env=self.env.replace(**vars(self.shortcuts)), shortcuts=Shortcuts())
        check_choice("inputs", self.inputs, get_args(Inputs))
        check_choice("critic", self.critic, get_args(Critic))
        there_are = self.env.residual.axes
        usual = tuple(axis for axis in ("forward", "vertical") if axis in there_are)
        store(self, axes=check_axes(self.axes or usual or there_are, there_are))
        check_count("timesteps", self.timesteps, 1, 1_000_000_000, "steps")
        check_count("seed", self.seed, 0, LARGEST_SEED)
        check_count("jobs", self.jobs, 1, 1000, "processes")
        check_count("evaluation_episodes", self.evaluation_episodes, 1, len(SELECTION))
        check_count("checkpoint_every", self.checkpoint_every, 1, unit="updates")
        if self.env.rendering.mode is not None:
            raise ConfigError("render_mode", self.env.rendering.mode, "not in a training")
        if self.env.jumps > 1:
            raise ConfigError("jumps", self.env.jumps, "1 in a training")
        if self.ppo.episodes % self.jobs:
            raise ConfigError("jobs", self.jobs, f"a divisor of ppo.episodes={self.ppo.episodes}")
        if self.cluster is not None:
            Cluster(self.cluster)
        if self.seeds is not None:
            self._check_seeds(self.seeds)
        if self.resume is not None and self.run not in (None, self.resume):
            raise ConfigError("run", str(self.run), "not with --resume, which names it")

    def _check_seeds(self, seeds: str) -> None:
        bounds = _RANGE.fullmatch(seeds)
        if bounds is None or not int(bounds[1]) <= int(bounds[2]) <= LARGEST_SEED:
            raise ConfigError("seeds", seeds, "the first and the last, such as 0..4")
        if self.seed != 0:
            raise ConfigError("seed", self.seed, "not with --seeds")
        if self.resume is not None:
            raise ConfigError("resume", str(self.resume), "not with --seeds, which goes on itself")

    @property
    def trainings(self) -> list[TrainOptions]:
        """That of each seed."""
        alone = dataclasses.replace(self, seeds=None, cluster=None)
        if self.seeds is None:
            return [alone]
        first, last = map(int, self.seeds.split(".."))
        return [
            dataclasses.replace(
                alone,
                seed=seed,
                run=self.run and self.run.with_name(f"{self.run.name}-seed{seed}"),
            )
            for seed in range(first, last + 1)
        ]

    @property
    def folder(self) -> Path:
        """Folder of the run."""
        default = Path("runs") / f"{self.env.controller_name}-seed{self.seed}"
        return self.resume or self.run or default

    @property
    def input_names(self) -> tuple[str, ...]:
        """Entries of the observation that the policy sees."""
        layout = self.env.layout
        names = tuple(layout.scales)
        match self.inputs:
            case "all":
                seen = list(layout.slices)
            case "balance":
                seen = [block for block in layout.slices if block not in JOINT_BLOCKS]
            case "command":
                seen = list(COMMAND_BLOCKS)
        return tuple(name for block in seen for name in names[layout.slices[block]])

    def as_dict(self) -> dict[str, Any]:
        """What the result depends on, for JSON."""
        values = dataclasses.asdict(self)
        for name in ("seeds", "cluster", "run", "resume", "config", "shortcuts"):
            del values[name]
        return values


def read_options(path: Path) -> TrainOptions:
    """Options from a file; what it does not say is as by default.

    Raises:
        ConfigError: If it is not a file of options, or a value is out of range; names the file.
    """
    try:
        return _from_file(path)
    except ConfigError as error:
        if error.value == str(path):
            raise
        raise type(error)(error.field, error.value, f"{error.allowed}, in {path}") from None


def _from_file(path: Path) -> TrainOptions:
    try:
        if path.exists() and not path.is_file():
            raise OSError("it is none")
        values = read_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigError("config", str(path), f"a JSON file ({error})") from None
    if not isinstance(values, dict):
        raise ConfigError("config", str(path), "a JSON object")
    top = _known("config", values, [*TrainOptions().as_dict(), COMMAND])
    env = top.pop("env", {})
    if not isinstance(env, dict):
        raise ConfigError("env", env, "a JSON object")
    ppo = _known("ppo", top.pop("ppo", {}), dataclasses.asdict(PPOOptions()))
    top.pop(COMMAND, None)
    jump = TASK.replace(**env)
    return TrainOptions(env=jump, ppo=PPOOptions(**ppo), **top)


def _known(name: str, values: Any, fields: Collection[str]) -> dict[str, Any]:
    """A copy of a mapping, all of whose keys are fields."""
    if not isinstance(values, dict):
        raise ConfigError(name, values, "a JSON object")
    for key in values:
        if key not in fields:
            allowed = f"no such field; the fields of {name} are {', '.join(fields)}"
            raise ConfigError(key, values[key], allowed)
    return dict(values)
