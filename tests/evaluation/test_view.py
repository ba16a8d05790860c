"""The jump shown live: paced and replayed as asked, untouched by its viewers."""

import signal
import threading

import numpy as np
import pytest
from shows import SHORT, Clock, ScriptedScreen

from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
from icub_jump_env.evaluation.modes import view
from icub_jump_env.evaluation.modes.view import FRAME, MAX_LAG, Playback, Show
from icub_jump_env.simulation.viewers.screen import Command


def quit_at_the_end(screen):
    return [Command.QUIT] if screen.captions[-1].get("phase") == "stood" else []


def show(screen, config=SHORT, **playback):
    """The episode that this screen showed, and the time (s) that it took."""
    clock = Clock()
    env = make_env(traced(config))
    pace = Playback(clock=clock, **playback)
    episode = Show(env, 0, screen, pace, threading.Event(), clock, clock.sleep).run()
    env.close()
    return episode, clock.time - 100.0


@pytest.fixture(scope="module")
def plain():
    env = make_env(SHORT)
    yield run_episode(env, 0)
    env.close()


# Pace


def test_an_instant_is_due_after_its_time_divided_by_the_speed():
    clock = Clock()
    playback = Playback(speed=0.25, clock=clock)
    assert playback.delay(0.0) == 0.0
    assert playback.delay(0.1) == pytest.approx(0.4)
    clock.time += 0.3
    assert playback.instant == pytest.approx(0.075)
    assert playback.delay(0.1) == pytest.approx(0.1)
    clock.time += 0.11
    assert playback.delay(0.1) == 0.0


def test_simulated_time_stands_still_in_a_pause():
    clock = Clock()
    playback = Playback(speed=0.5, clock=clock)
    clock.time += 0.2
    playback.obey(Command.PAUSE)
    assert playback.paused
    clock.time += 1000.0
    assert playback.instant == pytest.approx(0.1)
    assert playback.delay(0.2) == np.inf
    playback.obey(Command.PAUSE)
    assert not playback.paused
    assert playback.delay(0.2) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("command", "speeds"),
    [(Command.SLOWER, [1 / 8, 1 / 16, 1 / 32, 1 / 64, 1 / 64]), (Command.FASTER, [1 / 2, 1, 1])],
)
def test_the_speed_changes_from_now_on(command, speeds):
    clock = Clock()
    playback = Playback(speed=0.25, clock=clock)
    for speed in speeds:
        clock.time += 1.0
        before = playback.instant
        playback.obey(command)
        assert playback.speed == speed
        assert playback.instant == pytest.approx(before)
        clock.time += 1.0
        assert playback.instant == pytest.approx(before + speed)


def test_a_step_goes_to_the_instant_that_is_waited_for_and_pauses():
    clock = Clock()
    playback = Playback(clock=clock)
    for instant in (0.005, 0.010):
        assert playback.delay(instant) > 0.0
        playback.obey(Command.STEP)
        assert playback.delay(instant) == 0.0
        assert playback.paused
    assert playback.delay(0.015) == np.inf


def test_a_replay_starts_at_the_beginning_even_from_a_pause():
    clock = Clock()
    playback = Playback(paused=True, clock=clock)
    clock.time += 5.0
    playback.obey(Command.REPLAY)
    assert not playback.paused
    assert playback.instant == 0.0


def test_a_small_delay_is_made_up_for_and_a_large_one_is_not():
    for lag, makes_up in ((0.9 * MAX_LAG, True), (1.1 * MAX_LAG, False)):
        clock = Clock()
        playback = Playback(speed=0.25, clock=clock)
        clock.time += lag
        assert playback.delay(0.0) == 0.0
        assert playback.instant == pytest.approx(0.25 * lag if makes_up else 0.0)


# Episode


@pytest.mark.parametrize("speed", [1 / 8, 1.0])
def test_the_episode_shown_is_that_of_run_episode_at_the_speed_asked_for(plain, speed):
    screen = ScriptedScreen(quit_at_the_end)
    episode, duration = show(screen, speed=speed)
    assert episode == plain
    assert np.all(np.diff(screen.instants) > 0.0)
    assert screen.instants[0] == 0.0
    assert duration == pytest.approx(screen.instants[-1] / speed, abs=2 * FRAME)
    assert screen.captions[-1]["time"] == f"{screen.instants[-1]:.3f} s"
    assert {c["phase"] for c in screen.captions} >= {"launch", "flight", "landing", "stood"}


def test_pause_steps_and_replay_do_not_change_the_episode(plain):
    done = []

    def script(screen):
        if not done and screen.instants[-1] > 0.3:
            done.append("paused")
            return [Command.PAUSE]
        if done == ["paused"]:
            if len(screen.captions) % 3:
                return [Command.STEP]
            if screen.instants[-1] > 0.5:
                done.append("replayed")
                return [Command.FASTER, Command.REPLAY]
            return []
        return quit_at_the_end(screen)

    screen = ScriptedScreen(script)
    episode, _ = show(screen)
    assert done == ["paused", "replayed"]
    assert episode == plain
    (restart,) = np.flatnonzero(np.diff(screen.instants) < 0.0)
    assert screen.instants[restart] == pytest.approx(0.505)
    assert screen.instants[restart + 1] == 0.0
    assert screen.captions[0]["speed"] == "1/4 of real time"
    assert any(caption["speed"] == "1/4 of real time, paused" for caption in screen.captions)
    assert screen.captions[-1]["speed"] == "1/2 of real time"


def test_one_can_quit_in_the_middle_and_in_a_pause():
    screen = ScriptedScreen(lambda s: [Command.QUIT] if s.instants[-1] > 0.2 else [])
    assert show(screen)[0] is None
    screen = ScriptedScreen(lambda s: [Command.QUIT] if len(s.captions) > 50 else [])
    assert show(screen, paused=True)[0] is None
    assert screen.instants == [0.0]


def test_the_jump_can_be_seen_again_when_it_is_over(plain):
    ends = []

    def script(screen):
        if not quit_at_the_end(screen):
            return []
        ends.append(len(screen.instants))
        return [Command.REPLAY] if len(ends) < 3 else [Command.QUIT]

    screen = ScriptedScreen(script)
    assert show(screen, speed=1.0)[0] == plain
    assert ends == [ends[0], 2 * ends[0], 3 * ends[0]]


def test_a_second_ctrl_c_is_not_held_back():
    pressed = []
    previous = signal.signal(signal.SIGINT, lambda *_: pressed.append("twice"))
    try:
        with view.ctrl_c() as enough:
            signal.raise_signal(signal.SIGINT)
            assert enough.is_set()
            assert not pressed
            signal.raise_signal(signal.SIGINT)
            assert pressed == ["twice"]
    finally:
        signal.signal(signal.SIGINT, previous)
