"""Launches that end earlier or later: when they do, and what hindsight counts."""

import numpy as np
import pytest
from rich.console import Console

from experiments import takeoff_time
from experiments.takeoff_time import Delayed, TakeoffOptions, hindsight, play, render
from icub_jump_env.control.config import PhaseConfig
from icub_jump_env.control.phases import Phase
from icub_jump_env.errors import ConfigError


@pytest.mark.parametrize("later", [-0.01, 0.01])
def test_the_launch_ends_later(later):
    phases = Delayed(PhaseConfig(), later)
    assert phases.update(0.5 + later - 1e-6, 0.5, 300.0) is Phase.LAUNCH
    assert phases.update(0.5 + later + 1e-6, 0.5, 300.0) is Phase.FLIGHT


def test_hindsight_wants_two_neighbours():
    success = {
        -0.01: np.array([True, False, True, False]),
        0.0: np.array([False, True, False, False]),
        0.01: np.array([False, False, True, True]),
        0.02: np.array([False, False, True, False]),
    }
    assert hindsight(success) == 50.0


def test_without_delay_it_is_the_jump_itself(monkeypatch):
    monkeypatch.setattr(takeoff_time, "LATER", (-0.02, 0.0))
    played = play("velocity", range(1), Console(quiet=True))
    (early,), (planned,) = played.values()
    assert planned.jump["flight_height"] > early.jump["flight_height"] + 0.002
    console = Console(record=True, width=150)
    console.print(render({"velocity": played}, range(1)))
    assert "-20 ms" in console.export_text()


def test_more_episodes_than_tuning_seeds_are_refused():
    with pytest.raises(ConfigError, match="episodes"):
        TakeoffOptions(episodes=201)
