"""Command line of eval.py."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, NoReturn, TypeVar

import tyro
from rich.console import Console

from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ICubJumpError
from icub_jump_env.simulation.opengl import import_mujoco

T = TypeVar("T")

USAGE_ERROR = 2
INTERRUPTED = 130


@dataclass(frozen=True)
class EvalOptions:
    """Evaluate the jump and compare it with the paper.

    Runs the jump with and without the momentum constraint and prints the table.

    Attributes:
        config: The jump; every field of the environment's configuration is a flag.
        episodes: Episodes of each arm. Nothing is random so far: all come out alike.
        seed: Seed of the first episode; the next ones count up.
        json: Write everything to this file.
        plot: Draw the figures 1, 2 (torque controller: 3) and 6 into this folder.
        video: Record the jump to this file, such as jump.mp4 (extra 'video').
    """

    config: Annotated[JumpConfig, tyro.conf.arg(name="")] = field(default_factory=JumpConfig)
    episodes: int = 1
    seed: int = 0
    json: Path | None = None
    plot: Path | None = None
    video: Path | None = None

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 1)
        check_count("seed", self.seed, 0)


def parse(kind: type[T], arguments: Sequence[str]) -> T:
    """Parse a command line into ``kind``; on an error exit with one line.

    Raises:
        ConfigError: If a value is out of range.
    """
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.cli(kind, args=list(arguments))
    except SystemExit as end:
        if end.code in (0, None):
            raise
        _fail(_one_line(complaint.getvalue()))


def guarded(main: Callable[[], None]) -> None:
    """Run ``main``; any error that we foresee ends with one line and a non-zero exit."""
    try:
        main()
    except (ICubJumpError, OSError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)


def evaluate(arguments: Sequence[str]) -> None:
    """Run eval.py with these arguments."""
    guarded(lambda: _evaluate(parse(EvalOptions, arguments)))


def _evaluate(options: EvalOptions) -> None:
    import_mujoco()
    # Imported here so that --help and bad arguments answer at once.
    from icub_jump_env.evaluation.nominal import nominal_report, run_nominal
    from icub_jump_env.evaluation.output import check_writable, write_json
    from icub_jump_env.evaluation.table import comparison_rows, render_table, verdict

    momentum_control = options.config.momentum_control
    for name, path in (("json", options.json), ("video", options.video)):
        if path is not None:
            check_writable(name, path)
    if options.plot is not None:
        check_writable("plot", options.plot, folder=True)
    if options.video is not None:
        from icub_jump_env.evaluation.video import check_video, record_video

        check_video(options.video)

    console, progress = Console(), Console(stderr=True)
    arms = run_nominal(
        options.config,
        options.episodes,
        options.seed,
        trace=options.plot is not None,
        console=progress,
    )
    controller = options.config.controller
    rows = comparison_rows(options.config, arms[0].episodes, arms[1].episodes)
    title = (
        f"{options.config.jump_height * 100:g} cm jump, {controller} controller; "
        "the paper's: 4 cm after 11 cm"
    )
    console.print(render_table(rows, title, momentum_control))
    console.print(verdict(rows, momentum_control))
    if options.json is not None:
        write_json(options.json, nominal_report(arms, options.seed))
        console.print(f"wrote {options.json}")
    if options.plot is not None:
        from icub_jump_env.evaluation.figures import draw_figures

        episodes = {arm.name: arm.episodes[0] for arm in arms}
        for file in draw_figures(options.plot, options.config, episodes):
            console.print(f"wrote {file}")
    if options.video is not None:
        record_video(options.video, options.config, options.seed, progress)
        console.print(f"wrote {options.video}")


def _one_line(complaint: str) -> str:
    """The message inside tyro's box, without frame, title and advice."""
    lines = [line.strip("╭╮╰╯│─ ") for line in complaint.splitlines()]
    message = []
    for line in lines[1:]:
        if not line:
            break
        message.append(line)
    # tyro says so where a dataclass itself refused; the user knows no dataclass.
    return re.sub(r"^Error parsing \w*Options: ", "", " ".join(message)) or "bad arguments"


def _fail(message: str) -> NoReturn:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(USAGE_ERROR)
