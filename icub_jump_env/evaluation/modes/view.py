"""The jump shown live, in the browser or in a window, with pause and slow motion."""

from __future__ import annotations

import contextlib
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.episodes.contender import Contender
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.evaluation.report.output import say
from icub_jump_env.policy import BASELINE, Policy
from icub_jump_env.simulation.viewers.screen import KEYS, Caption, Command, Screen
from icub_jump_env.simulation.viewers.window import WindowScreen, check_window

SLOW_MOTION = 0.25
"""Simulated seconds per second at the start."""

SLOWEST = 1 / 64

FRAME = 1 / 60
"""Time (s) between two pictures."""

MAX_LAG = 0.25
"""Delay (s) that is made up for; a machine slower than that shows the jump slower."""


class Playback:
    """Says when a simulated instant is due: in slow motion, with pauses.

    Attributes:
        speed: Simulated seconds per second.
        paused: Whether simulated time stands still.
    """

    def __init__(
        self,
        speed: float = SLOW_MOTION,
        paused: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.speed = speed
        self.paused = paused
        self._clock = clock
        self._awaited = 0.0
        self._go_to(0.0)

    @property
    def instant(self) -> float:
        """The simulated time (s) that is due now."""
        then, instant = self._anchor
        return instant if self.paused else instant + (self._clock() - then) * self.speed

    def obey(self, command: Command) -> None:
        """Change pause, speed or instant from now on."""
        instant = self.instant
        if command is Command.REPLAY:
            instant = 0.0
            self.paused = False
        elif command is Command.PAUSE:
            self.paused = not self.paused
        elif command is Command.STEP:
            instant = self._awaited
            self.paused = True
        elif command is Command.SLOWER:
            self.speed = max(self.speed / 2, SLOWEST)
        elif command is Command.FASTER:
            self.speed = min(self.speed * 2, 1.0)
        self._go_to(instant)

    def delay(self, instant: float) -> float:
        """Time (s) until a simulated instant is due; zero if it is, infinite in a pause."""
        self._awaited = instant
        missing = instant - self.instant
        if missing > 1e-9:  # less is rounding
            return math.inf if self.paused else missing / self.speed
        if -missing > MAX_LAG * self.speed:
            self._go_to(instant)
        return 0.0

    def _go_to(self, instant: float) -> None:
        self._anchor = self._clock(), instant


class _Replay(Exception):  # noqa: N818 (a request, not an error)
    """The user wants to see the jump from the beginning."""


class _Quit(Exception):  # noqa: N818
    """The user has seen enough."""


@dataclass
class Show:
    """The episode of :func:`run_episode` on a screen, which slows it down and repeats it.

    Attributes:
        env: The environment.
        seed: Seed of the episode.
        screen: Where to show it.
        playback: How fast.
        enough: Another way to quit.
        clock: Tells the time (s).
        sleep: Waits for a time (s).
        policy: What acts.
        hold: Steps that an action is held.
    """

    env: ICubJumpEnv
    seed: int
    screen: Screen
    playback: Playback
    enough: threading.Event
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    policy: Policy = BASELINE
    hold: int = 1
    _refreshed: float = field(default=-math.inf, init=False)
    _scene: Caption = field(default_factory=dict, init=False)

    def run(self) -> Episode | None:
        """Show the episode as often as the user likes, until the user quits.

        Returns:
            The episode last shown to its end, if any.
        """
        episode = None
        while True:
            try:
                episode = run_episode(
                    self.env, self.seed, self.policy, on_step=self._present, hold=self.hold
                )
                self._scene["phase"] = episode.outcome
                while True:
                    self._attend()
                    self.sleep(FRAME)
            except _Replay:
                continue
            except _Quit:
                return episode

    def _present(self, env: ICubJumpEnv) -> None:
        """Show the present state once it is due."""
        instant = env.data.time
        while (delay := self.playback.delay(instant)) > 0.0:
            self._attend()
            self.sleep(min(delay, FRAME))
        self.screen.show(env.data)
        self._scene = {"time": f"{instant:.3f} s", "phase": env.snapshot().phase}
        self._attend()

    def _attend(self) -> None:
        """Refresh the screen and do what the user asks for, once per frame.

        MuJoCo's viewer may take a frame's time to refresh: not for each control tick.
        """
        if self.enough.is_set():
            raise _Quit
        if self.clock() - self._refreshed < FRAME:
            return
        slower = round(1.0 / self.playback.speed)
        speed = "real time" if slower == 1 else f"1/{slower} of real time"
        paused = ", paused" if self.playback.paused else ""
        commands = self.screen.refresh(self._scene | {"speed": speed + paused})
        self._refreshed = self.clock()
        for command in commands:
            self.playback.obey(command)
        if Command.QUIT in commands:
            raise _Quit
        if Command.REPLAY in commands:
            raise _Replay


def in_browser() -> bool:
    """Whether there can be no window, so that the jump is shown in the browser."""
    if sys.platform == "darwin":  # only mjpython can open a window there
        return True
    try:
        check_window()
    except MissingDependencyError:
        return True
    return False


def open_screen(model: Any, browser: bool, console: Console) -> Screen:
    """Open a window or serve a page, and say how to use it.

    Raises:
        MissingDependencyError: If that is impossible.
        WorkerError: If the page's server does not come up.
    """
    if not browser:
        screen: Screen = WindowScreen(model)
        end = "close the window"
    else:
        try:
            from icub_jump_env.simulation.viewers.browser import BrowserScreen
        except ImportError as error:
            raise MissingDependencyError(
                f"viewing in the browser needs MuJoCo Studio ({error}): pip install mujoco"
            ) from error
        screen = page = BrowserScreen(model)
        say(console, f"open {page.address} in a browser on this machine")
        end = "Quit"
    say(console, f"{KEYS}, {end} or Ctrl-C: end")
    return screen


@contextlib.contextmanager
def ctrl_c() -> Iterator[threading.Event]:
    """Set an event at Ctrl-C instead of interrupting: windows left alone crash at the end.

    A second Ctrl-C interrupts.
    """
    pressed = threading.Event()

    def press(*_: Any) -> None:
        pressed.set()
        signal.signal(signal.SIGINT, previous)

    previous = signal.signal(signal.SIGINT, press)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, previous)


def run(
    options: EvalOptions, contenders: Sequence[Contender], console: Console, _: Console
) -> None:
    """Run ``eval.py --view``."""
    view(options.config, options.seed, console, policy=contenders[0].policy)


def view(config: JumpConfig, seed: int, console: Console, policy: Policy = BASELINE) -> None:
    """Show the jump live until the user quits: in a window if there can be one.

    Args:
        config: The jump.
        seed: Seed of the episode.
        console: Where the address and the keys are written.
        policy: What acts.

    Raises:
        MissingDependencyError: If the jump cannot be shown.
        WorkerError: If the page's server does not come up, or dies.
    """
    browser = in_browser()
    # Any mode loads the meshes; this one opens nothing before it is asked for a picture. A step
    # per control tick makes slow motion smooth.
    env = make_env(traced(config).replace(render_mode="rgb_array"))
    with (
        contextlib.closing(env),
        ctrl_c() as enough,
        contextlib.closing(open_screen(env.model, browser, console)) as screen,
    ):
        # A page takes seconds to load: there the user starts the jump.
        playback = Playback(paused=browser)
        hold = config.controls_per_step
        Show(env, seed, screen, playback, enough, policy=policy, hold=hold).run()
