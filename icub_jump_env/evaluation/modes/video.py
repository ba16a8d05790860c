"""A video of the jump."""

from __future__ import annotations

import contextlib
from pathlib import Path

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.report.output import progress_display
from icub_jump_env.policy import BASELINE, Policy
from icub_jump_env.simulation.opengl import open_context

SLOW_MOTION = 4
"""Playback is this many times slower than real time."""

AFTER_LANDING = 0.6
"""How much of the standing is shown (s)."""

FORMATS = (".mp4", ".gif")


def check_video(file: Path) -> None:
    """Refuse early if a video cannot be recorded here.

    Raises:
        ConfigError: If the file's suffix is no video format.
        MissingDependencyError: Naming the remedy.
    """
    if file.suffix.lower() not in FORMATS:
        raise ConfigError("video", str(file), f"a file name ending in {' or '.join(FORMATS)}")
    try:
        import imageio.v3  # noqa: F401 (only to see whether it is there)
        import imageio_ffmpeg  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError.of_extra("writing video", "video") from error
    open_context(1, 1).free()


def record_video(
    file: Path, config: JumpConfig, seed: int, console: Console, policy: Policy = BASELINE
) -> None:
    """Record one jump in slow motion.

    Args:
        file: Video file; its suffix chooses the format, such as ``.mp4``.
        config: The jump.
        seed: Seed of the episode.
        console: Where the progress is shown.
        policy: What acts.

    Raises:
        ConfigError: If the file's suffix is no video format.
        MissingDependencyError: If the extra or OpenGL is missing.
    """
    check_video(file)
    import imageio.v3 as iio

    config = config.replace(
        render_mode="rgb_array", stand_time=min(config.success.stand_time, AFTER_LANDING)
    )
    frames = []
    with progress_display(console) as progress, contextlib.closing(make_env(config)) as env:
        task = progress.add_task("recording", total=None)

        def shoot(env: ICubJumpEnv) -> None:
            frames.append(env.render())
            progress.advance(task)

        run_episode(env, seed, policy, on_step=shoot)
    # Complete or not at all: a full disk or an interrupt leaves an earlier video as it was.
    part = file.with_name(f".{file.stem}.part{file.suffix}")
    try:
        rate = max(1, round(config.agent_frequency / SLOW_MOTION))
        if part.suffix.lower() == ".mp4":
            iio.imwrite(part, frames, fps=rate)
            _check_movie(part, file, len(frames))
        else:
            iio.imwrite(part, frames, fps=rate, loop=0)  # for ever
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)


def _check_movie(part: Path, file: Path, pictures: int) -> None:
    """The encoder is a process of its own, whose failure is not reported."""
    from imageio_ffmpeg import count_frames_and_secs

    try:
        written, _ = count_frames_and_secs(str(part))
    except RuntimeError:
        written = 0
    if written != pictures:
        raise OSError(f"{file}: {written} of {pictures} pictures could be written; disk full?")
