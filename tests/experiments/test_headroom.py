"""The measurement of the headroom: what counts, and when an action begins."""

import numpy as np
import pytest
from rich.console import Console

from experiments.headroom import (
    GRID,
    REGIMES,
    ZERO,
    Line,
    Shift,
    Start,
    constants,
    measure,
    render,
    robust,
    starts,
)
from experiments.headroom import HeadroomOptions as Options
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.observation import DEFAULT
from icub_jump_env.planning.residual import AXES


def seen(time):
    observation = np.zeros(DEFAULT.size, np.float32)
    observation[DEFAULT.slices["time"]] = time
    return observation


def test_a_shift_begins_at_its_time():
    shift = Shift((0.1, 0.2), 0.25)
    assert not shift(seen(0.24)).any()
    np.testing.assert_allclose(shift(seen(0.25)), [0.1, 0.2], rtol=1e-6)


def test_hindsight_wants_two_neighbours():
    success = {key: np.zeros(4, bool) for key in constants()}
    success[Line("forward", 0.2)][:] = True, True, True, False
    success[Line("forward", 0.4)][:] = True, False, False, False
    success[Line("forward", 0.8)][:] = False, True, False, False  # no neighbour of 0.2
    success[Line("pitch", 0.0)][:] = False, False, True, False
    success[Line("pitch", 0.5)][:] = False, False, True, False
    assert robust(success).tolist() == [True, False, True, False]


def test_the_line_is_within_the_range():
    start = Start((0.05, -0.5), 0.1)
    for axis in ("forward", "pitch"):
        action = dict(zip(AXES, Line(axis, 0.2, -2.0).policy(start).action, strict=True))
        assert action.pop(axis) == pytest.approx(0.1)
        assert not any(action.values())
    assert Line("lateral", 0.0, 3.0).policy(start).action[AXES.index("lateral")] == -1.0


def test_it_can_begin_with_the_push():
    start = Start((0.05, 0.0), 0.25)
    assert Line("pitch", 0.5).policy(start).start == 0.0
    assert Line("pitch", 0.5, after_push=True).policy(start).start == 0.25


def test_zero_is_in_the_grid_of_each_axis():
    assert set(GRID) == set(AXES)
    assert all(0.0 in values for values in GRID.values())


def test_pushes_begin_within_the_launch():
    config = JumpConfig.of(**REGIMES["disturbed"])
    begun = starts(config, range(3))
    assert len({start.lean for start in begun}) == 3
    assert all(0.0 <= start.push <= 0.5 for start in begun)


@pytest.fixture
def small(monkeypatch):
    """A measurement of few actions, in a world."""
    monkeypatch.setattr("experiments.headroom.GRID", {"forward": (0.0, 0.1), "pitch": (0.0, 0.1)})
    monkeypatch.setattr("experiments.headroom.LINES", (("pitch", (0.0,), (-2.0,)),))

    def measured(world, episodes):
        config = JumpConfig.of(randomization=world, residual_axes=AXES, early_end=True)
        return measure(config, episodes, 1, Console(quiet=True))

    return measured


def told(found):
    console = Console(record=True, width=150)
    console.print(render(Options(episodes=2), {("full", "velocity"): found}))
    return console.export_text()


def test_where_nothing_fails_nothing_is_chosen(small):
    found = small("none", 2)
    for name in ("zero", "constant", "line", "hindsight", "after the push"):
        assert found[name].tolist() == [True, True]
    assert found["chosen constant"] == found["chosen line"] == ZERO
    assert told(found).split().count("zero") == 3


def test_elsewhere_hindsight_loses_nothing(small):
    found = small("disturbed", 4)
    zero = found["zero"]
    assert not zero.all()
    for name in ("hindsight", "after the push"):
        assert (found[name] >= zero).all()
    assert found["chosen line"] == Line("pitch", 0.0, -2.0)
    assert "pitch +0 -2 lean" in told(found)


@pytest.mark.parametrize("change", [{"jobs": 0}, {"regimes": ("calm",)}, {"env": "ICubJump-v7"}])
def test_bad_options_are_refused(change):
    with pytest.raises(ConfigError, match=next(iter(change))):
        Options(**change)
