"""One training run: learn, evaluate, save, and go on where it stopped."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from torch.utils.tensorboard import SummaryWriter

from icub_jump_env.errors import ConfigError, PolicyFileError
from icub_jump_env.evaluation.quantities import CM, DEG, PERCENT, commands, number
from icub_jump_env.evaluation.report.output import progress_display, say, write_json
from icub_jump_env.evaluation.report.provenance import SOURCE, command, source, versions
from icub_jump_env.evaluation.statistics.summary import Command, command_range
from icub_jump_env.files import read_json
from icub_jump_env.policy import load_policy, save_policy
from icub_jump_env.policy.fields import check_command

from .checkpoints import (
    Checkpoint,
    begin_segment,
    load_latest,
    restore,
    save_checkpoint,
    segment_seeds,
)
from .curve import check_progress, curve_point, read_minutes
from .environment import LaunchEnv, acting_steps
from .options import COMMAND, OPTIONS, SELECTION, TrainOptions, read_options
from .ppo import export, freeze_policy, make_model, set_noise, whiten
from .run_folder import lock_run
from .vec_env import JumpVecEnv

CURVE = "curve.json"
"""Its evaluations, the minutes each took with the steps before it, and its seeds."""
BEST = "best.safetensors"
"""The policy with the largest mean reward in an evaluation."""
LAST = "last.safetensors"
"""That of the latest evaluation."""

MOST_CHECKPOINTS = 500
"""Of a run; the learning curve is in each of them, whose size is limited."""

PACKAGES = ("stable-baselines3", "torch")
"""Those on which a training depends, besides the environment's."""


def train(
    options: TrainOptions,
    console: Console,
    on_checkpoint: Callable[[int], None] = lambda timesteps: None,
) -> int:
    """Train, from the beginning or from the latest checkpoint.

    Args:
        options: What to train.
        console: Where to report.
        on_checkpoint: Called with the number of steps so far, once a checkpoint is written.

    Returns:
        The number of steps at the end.

    Raises:
        ConfigError: If the folder holds another run, or the run had too many checkpoints.
        RunLockedError: If another process writes to it.
        CheckpointError: If it is to be resumed and all its checkpoints are damaged.
        WorkerError: If a worker dies or meets an error.
        OSError: If the file system refuses.
    """
    folder = options.folder
    with claimed(options, console) as words:
        checkpoint = load_latest(folder, partial(say, console))
        if checkpoint is not None and checkpoint.num_timesteps >= options.timesteps:
            say(console, f"{folder} is finished")
            return checkpoint.num_timesteps
        if checkpoint is None and options.resume is not None:
            say(console, f"no checkpoint in {folder}: starting from step 0")
        make = partial(
            LaunchEnv, options.env, options.input_names, options.axes, options.critic == "world"
        )
        with contextlib.closing(JumpVecEnv([make] * options.jobs)) as env:
            timesteps = _learn(options, words, env, checkpoint, console, on_checkpoint)
        say(console, f"wrote {folder / BEST}")
    return timesteps


@contextlib.contextmanager
def claimed(options: TrainOptions, console: Console) -> Iterator[Sequence[str]]:
    """Keep others out of the run's folder, which holds this run or nothing.

    Yields:
        The words of the command that began the run.

    Raises:
        ConfigError: If the folder holds another run, or the run had too many checkpoints.
        RunLockedError: If another process writes to it.
        OSError: If the file system refuses.
    """
    _check_checkpoints(options)
    with _named(options.folder), lock_run(options.folder):
        yield _claim(options, console)


def _check_checkpoints(options: TrainOptions) -> None:
    updates = options.timesteps / (options.ppo.episodes * acting_steps(options.env))
    least = math.ceil(updates / MOST_CHECKPOINTS)
    if options.checkpoint_every < least:
        allowed = f"at least {least}: a run has at most {MOST_CHECKPOINTS} checkpoints"
        raise ConfigError("checkpoint_every", options.checkpoint_every, allowed)


@contextlib.contextmanager
def _named(folder: Path) -> Iterator[None]:
    """A full disk says where."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, str(folder)) from error


def _claim(options: TrainOptions, console: Console) -> Sequence[str]:
    """See that the folder holds this run or nothing.

    Returns:
        The words of the command that began the run.
    """
    folder, file = options.folder, options.folder / OPTIONS
    if options.resume is None:
        if file.exists() or any(folder.glob("checkpoint-*")):
            raise ConfigError("run", str(folder), f"a folder without a run, or --resume {folder}")
        words = command()
        write_json(file, {COMMAND: words, **options.as_dict()})
        return words
    if other_code(options.folder / LAST):
        say(
            console,
            f"{options.folder} was begun with other code: it will not end as it would have",
        )
    for flag, value, recorded in _differences(_flags(options), _flags(read_options(file))):
        raise ConfigError(flag, value, f"{recorded!r}, as {file} has it")
    return check_command(read_json(file.read_bytes()).get(COMMAND, command()))


def other_code(file: Path) -> bool:
    """Whether a run's policy jumped with other code than the present; not if it is unreadable."""
    try:
        return load_policy(file).card.versions.get(SOURCE) != source()
    except PolicyFileError:
        return False


def _flags(options: TrainOptions) -> dict[str, Any]:
    """What the result depends on, by the names on the command line."""
    values = options.as_dict()
    env: dict[str, Any] = values.pop("env")
    return values | env


def _differences(
    ours: Mapping[str, Any], theirs: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Name and both values of what differs, inside the groups that both have."""
    for name, value in ours.items():
        other = theirs[name]
        if (
            isinstance(value, Mapping)
            and isinstance(other, Mapping)
            and value.keys() == other.keys()
        ):
            yield from _differences(value, other, f"{prefix}{name}.")
        elif value != other:
            yield prefix + name, value, other


def _learn(
    options: TrainOptions,
    words: Sequence[str],
    env: JumpVecEnv,
    checkpoint: Checkpoint | None,
    console: Console,
    on_checkpoint: Callable[[int], None],
) -> int:
    model = make_model(options, env)
    folder = str(options.folder / "tensorboard")
    board = TensorBoardOutputFormat(folder)
    if checkpoint is not None:
        restore(model, checkpoint)
        # What was logged after the checkpoint will be logged again.
        board.writer.close()
        board.writer = SummaryWriter(folder, purge_step=model.num_timesteps + 1)
    logger = Logger(str(options.folder), [board])
    # Without the time left, which would ignore the evaluations to come.
    columns = TextColumn("learning"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with contextlib.closing(logger), progress_display(console, *columns) as display:
        model.set_logger(logger)
        task = display.add_task("learning", total=options.timesteps)
        run = _Run(options, words, console, display, task, on_checkpoint)
        if checkpoint is not None:
            run.resume(checkpoint.number, checkpoint.progress)
            say(console, f"going on from step {model.num_timesteps} of {options.timesteps}")
        start, before = time.monotonic(), model.num_timesteps
        remaining = options.timesteps - before
        model.learn(remaining, callback=run, reset_num_timesteps=checkpoint is None)
    wall = time.monotonic() - start
    rate = (model.num_timesteps - before) / wall
    say(console, f"{wall / 60:.1f} min, {rate:.0f} steps/s, evaluations included")
    return model.num_timesteps


class _Run(BaseCallback):
    """Does around Stable-Baselines3's learning what a run consists of besides.

    Checkpoints come where a rollout begins: the policy is evaluated, all is saved, and
    every generator and environment starts anew from a recorded seed. A run that goes on
    from a checkpoint does the same.
    """

    model: PPO

    def __init__(
        self,
        options: TrainOptions,
        words: Sequence[str],
        console: Console,
        display: Progress,
        task: TaskID,
        on_checkpoint: Callable[[int], None],
    ) -> None:
        super().__init__()
        self._options = options
        self._command = words
        self._console = console
        self._display = display
        self._task = task
        self._on_checkpoint = on_checkpoint
        self._updates = 0
        self._number = 0
        self._curve: list[dict[str, Any]] = []
        self._minutes: list[float | None] = []
        self._since = time.monotonic()
        self._seeds: list[list[int]] = []
        self._episodes: list[dict[str, Any]] = []
        self._resumed = False

    def resume(self, number: int, progress: Mapping[str, Any]) -> None:
        """Take up what a checkpoint noted."""
        self._number, self._resumed = number, True
        self._updates, self._curve = check_progress(number, progress)
        self._minutes = read_minutes(self._options.folder / CURVE, len(self._curve))
        seed, jobs = self._options.seed, self._options.jobs
        self._seeds = [segment_seeds(seed, earlier, jobs) for earlier in range(1, number)]

    @property
    def _env(self) -> JumpVecEnv:
        env = self.model.get_env()
        assert isinstance(env, JumpVecEnv)
        return env

    @property
    def _action_scale(self) -> float:
        ppo = self._options.ppo
        share = (self._updates + 1) / (ppo.ramp + 1)
        return max(1e-3, ppo.action_scale * min(1.0, share))

    def _on_training_start(self) -> None:
        if not self._resumed:
            whiten(self.model, self._options)

    def _on_rollout_start(self) -> None:
        if self._resumed:
            self._resumed = False
            self._begin_segment()
        elif self._updates % self._options.checkpoint_every == 0:
            self._checkpoint()
            self._begin_segment()
        self.logger.record("rollout/noise", set_noise(self.model, self._options))
        freeze_policy(self.model, self._updates < self._options.ppo.warmup)
        self._env.env_method("scale_actions", self._action_scale)

    def _on_step(self) -> bool:
        for done, info in zip(self.locals["dones"], self.locals["infos"], strict=True):
            if done:
                self._episodes.append(info)
        self._display.update(self._task, completed=self.model.num_timesteps)
        return True

    def _on_rollout_end(self) -> None:
        self._log_episodes()
        self.logger.record("rollout/residual_size", self._residual_size())
        self.logger.dump(self.model.num_timesteps)
        self._updates += 1

    def _on_training_end(self) -> None:
        self._checkpoint()

    def _log_episodes(self) -> None:
        record = self.logger.record
        infos, self._episodes = self._episodes, []
        success: dict[Command, list[bool]] = {}
        for info in infos:
            success.setdefault(command_range(info["jump_height"]), []).append(info["is_success"])
        for bounds, successes in success.items():
            record(f"rollout/success_{commands(*bounds).replace(' ', '_')}", np.mean(successes))
        jumps = [info["jump"] for info in infos]
        record("rollout/success", np.mean([info["is_success"] for info in infos]))
        record("rollout/landed", np.mean([jump["landed"] for jump in jumps]))
        record("rollout/rise_cm", CM * np.mean([jump["flight_height"] for jump in jumps]))
        rotations = [abs(jump["flight_rotation"]) for jump in jumps if jump["flight_time"]]
        if rotations:
            record("rollout/rotation_deg", DEG * np.median(rotations))

    def _residual_size(self) -> float:
        """Mean size of the policy's actions, without exploration."""
        observations = self.model.rollout_buffer.observations
        assert isinstance(observations, np.ndarray)  # of one Box
        with torch.no_grad():
            flat = torch.as_tensor(observations.reshape(-1, observations.shape[-1]))
            actions = self.model.policy.get_distribution(flat).mode().numpy()
        return float(self._action_scale * np.abs(np.clip(actions, -1.0, 1.0)).mean())

    def _checkpoint(self) -> None:
        """Evaluate and save."""
        self._number += 1
        self._evaluate()
        progress = {"updates": self._updates, "curve": self._curve}
        save_checkpoint(self._options.folder, self.model, self._number, progress)
        self._on_checkpoint(self.model.num_timesteps)

    def _begin_segment(self) -> None:
        self._seeds.append(begin_segment(self.model, self._options.seed, self._number))

    def _evaluate(self) -> None:
        policy = export(self.model, self._options, self._action_scale)
        seeds = SELECTION[: self._options.evaluation_episodes]
        episodes = self._env.evaluate(policy, seeds)
        self._curve.append(curve_point(self.model.num_timesteps, episodes))
        now = time.monotonic()
        self._minutes.append(round((now - self._since) / 60, 3))
        self._since = now
        newest = self._curve[-1]
        for name in ("score", "success", "landed"):
            self.logger.record(f"evaluation/{name}", newest[name])
        self.logger.record("evaluation/rise_cm", CM * newest["rise"])
        if newest["rotation"] is not None:
            self.logger.record("evaluation/rotation_deg", DEG * newest["rotation"])
        self.logger.dump(self.model.num_timesteps)
        self._save_policy(LAST)
        if newest["score"] >= max(point["score"] for point in self._curve):
            self._save_policy(BEST)
        write_json(
            self._options.folder / CURVE,
            {
                "evaluations": self._curve,
                "minutes": self._minutes,
                "seed": self._options.seed,
                "episode_seeds": self._seeds,
                "evaluation_seeds": [seeds.start, seeds.stop],
            },
        )
        say(
            self._console,
            f"{newest['timesteps']} steps: success {PERCENT * newest['success']:.1f} %, "
            f"rise {number(newest['rise'], 'cm')} cm",
        )

    def _save_policy(self, name: str) -> None:
        save_policy(
            self._options.folder / name,
            export(self.model, self._options, self._action_scale),
            config=self._options.env,
            versions=versions(*PACKAGES) | {SOURCE: source()},
            command=self._command,
            seed=self._options.seed,
            results={"evaluation": self._curve[-1]},
        )
