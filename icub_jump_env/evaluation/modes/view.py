"""The jump shown live, in the browser or in a window, with pause and slow motion."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Literal

from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.policy import BASELINE, Policy
from icub_jump_env.simulation.viewers.screen import KEYS, Caption, Command, Screen
from icub_jump_env.simulation.viewers.window import WindowScreen, check_window

Place = Literal["auto", "browser", "window"]

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


class Show:
    """The episode of :func:`run_episode` on a screen, which slows it down and repeats it."""

    def __init__(
        self,
        env: ICubJumpEnv,
        seed: int,
        screen: Screen,
        playback: Playback,
        enough: threading.Event,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        policy: Policy = BASELINE,
        hold: int = 1,
    ) -> None:
        """Prepare it.

        Args:
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
        self._env = env
        self._seed = seed
        self._policy = policy
        self._hold = hold
        self._screen = screen
        self._playback = playback
        self._enough = enough
        self._clock = clock
        self._sleep = sleep
        self._refreshed = -math.inf
        self._scene: Caption = {}

    def run(self) -> Episode | None:
        """Show the episode as often as the user likes, until the user quits.

        Returns:
            The episode last shown to its end, if any.
        """
        episode = None
        while True:
            try:
                episode = run_episode(
                    self._env, self._seed, self._policy, on_step=self._present, hold=self._hold
                )
                self._scene["phase"] = episode.outcome
                while True:
                    self._attend()
                    self._sleep(FRAME)
            except _Replay:
                continue
            except _Quit:
                return episode

    def _present(self, env: ICubJumpEnv) -> None:
        """Show the present state once it is due."""
        instant = env.data.time
        while (delay := self._playback.delay(instant)) > 0.0:
            self._attend()
            self._sleep(min(delay, FRAME))
        self._screen.show(env.data)
        self._scene = {"time": f"{instant:.3f} s", "phase": env.snapshot().phase}
        self._attend()

    def _attend(self) -> None:
        """Refresh the screen and do what the user asks for, once per frame.

        MuJoCo's viewer may take a frame's time to refresh: not for each control tick.
        """
        if self._enough.is_set():
            raise _Quit
        if self._clock() - self._refreshed < FRAME:
            return
        slower = round(1.0 / self._playback.speed)
        speed = "real time" if slower == 1 else f"1/{slower} of real time"
        paused = ", paused" if self._playback.paused else ""
        commands = self._screen.refresh(self._scene | {"speed": speed + paused})
        self._refreshed = self._clock()
        for command in commands:
            self._playback.obey(command)
        if Command.QUIT in commands:
            raise _Quit
        if Command.REPLAY in commands:
            raise _Replay


def in_browser(place: Place) -> bool:
    """Whether to show the jump in the browser: if asked to, or if there can be no window."""
    if place != "auto":
        return place == "browser"
    if sys.platform == "darwin":  # only mjpython can open a window there
        return True
    try:
        check_window()
    except MissingDependencyError:
        return True
    return False


def open_browser_screen(model: Any, port: int, console: Console) -> Screen:
    """Serve a page with the jump and say where it is.

    Raises:
        ConfigError: If the port is taken.
        MissingDependencyError: If MuJoCo Studio is missing.
    """
    try:
        from icub_jump_env.simulation.viewers.browser import BrowserScreen
    except ImportError as error:
        raise MissingDependencyError(
            f"viewing in the browser needs MuJoCo Studio ({error}): pip install mujoco"
        ) from error
    screen = BrowserScreen(model, port)
    console.print(f"open {screen.address} in a browser on this machine", soft_wrap=True)
    console.print(f"{KEYS}, Quit or Ctrl-C: end", soft_wrap=True)
    return screen


def open_window_screen(model: Any, console: Console) -> Screen:
    """Open a window and say how to use it.

    Raises:
        MissingDependencyError: If that is impossible.
    """
    screen = WindowScreen(model)
    console.print(f"{KEYS}, close the window or Ctrl-C: end", soft_wrap=True)
    return screen


@contextlib.contextmanager
def ctrl_c() -> Iterator[threading.Event]:
    """Set an event at Ctrl-C instead of interrupting: viewers left alone crash at the end.

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


def view(
    config: JumpConfig,
    seed: int,
    console: Console,
    place: Place = "auto",
    port: int = 0,
    policy: Policy = BASELINE,
) -> None:
    """Show the jump live until the user quits.

    Args:
        config: The jump.
        seed: Seed of the episode.
        console: Where the address and the keys are written.
        place: Where to show it: in a window, in the browser, or in whichever there can be.
        port: Port of the browser's page; 0 takes a free one.
        policy: What acts.

    Raises:
        ConfigError: If the port is taken.
        MissingDependencyError: If the jump cannot be shown there.
    """
    browser = in_browser(place)
    # Any mode loads the meshes; this one opens nothing before it is asked for a picture. A step
    # per control tick makes slow motion smooth.
    env = make_env(dataclasses.replace(traced(config), render_mode="rgb_array"))
    with contextlib.closing(env), ctrl_c() as enough:
        if browser:
            screen = open_browser_screen(env.model, port, console)
        else:
            screen = open_window_screen(env.model, console)
        with contextlib.closing(screen):
            # A page takes seconds to load: there the user starts the jump.
            playback = Playback(paused=browser)
            Show(
                env, seed, screen, playback, enough, policy=policy, hold=config.controls_per_step
            ).run()
