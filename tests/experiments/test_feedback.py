"""What a policy feels and does: the table of a linear one, and the picture."""

from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from agents.options import TASK
from experiments import feedback
from experiments.feedback import FeedbackOptions, Launches, render, run, watch
from experiments.figures import feedback_figure
from icub_jump_env.errors import ConfigError
from icub_jump_env.policy import NetworkPolicy, load_policy, save_policy

CONFIG = TASK.replace(randomization="disturbed", stand_time=0.1, jump_height=(0.04, 0.06))
INPUTS = ("time", "gravity.x", "gyro.y")


def saved(*layers):
    policy = NetworkPolicy(INPUTS, layers, ("forward", "vertical"))
    path = Path("shipped/disturbed-velocity.safetensors")
    path.parent.mkdir(exist_ok=True)
    save_policy(
        path, policy, config=CONFIG, versions={}, command=("python", "x"), seed=None, results={}
    )
    return load_policy(path)


def layer(weight):
    weight = np.array(weight, np.float32)
    return weight, np.zeros(len(weight), np.float32)


LINEAR = layer([[0.1, 0.0, -0.2], [0.0, 1.0, 0.0]])


def test_what_was_seen_explains_what_was_done():
    launches = watch(saved(LINEAR), range(2), Console(quiet=True))
    n, steps = launches.actions.shape[:2]
    assert n == 2
    assert launches.time[1] == pytest.approx(0.01)
    np.testing.assert_allclose(
        launches.actions[..., [0, 2]], launches.inputs @ LINEAR[0].T, rtol=0, atol=1e-6
    )
    np.testing.assert_allclose(launches.inputs[:, :, 0], [launches.time] * 2, rtol=0, atol=0.02)
    assert (launches.push_time < launches.time[-1] + 0.1).all()
    assert steps == len(launches.time)


def table_of(weight, inputs):
    launches = Launches(np.arange(2.0), inputs, *4 * (np.zeros(1),))
    table = render(saved(layer(weight)), launches)
    return [list(column.cells) for column in table.columns]


def test_the_table_begins_with_what_moves_an_axis_most(monkeypatch):
    monkeypatch.setattr(feedback, "SHOWN", 2)
    inputs = np.array([[[-1.0, -2.0, 0.0], [1.0, 2.0, 0.0]]])  # deviations 1, 2 and 0
    axes, first, second = table_of([[0.1, -0.2, 9.0], [0.5, 0.1, 9.0]], inputs)
    assert axes == ["forward", "vertical"]
    assert first == ["gravity.x -0.40", "time +0.50"]
    assert second == ["time +0.10", "gravity.x +0.20"]


def test_a_network_has_no_such_table():
    policy = saved(layer(np.ones((4, 3))), layer(np.ones((2, 4))))
    with pytest.raises(ConfigError, match="a linear one"):
        render(policy, Launches(*6 * (np.zeros(1),)))


def test_the_picture_has_the_middle_of_each_group():
    rng = np.random.default_rng(0)
    n, k = 60, 40
    slope, push = rng.uniform(-0.08, 0.08, n), rng.uniform(-6, 6, n)
    time = 0.01 * np.arange(k)
    # The action is the sign of the slope, from the end of the push on also that of the push.
    end = np.full(n, 0.2)
    actions = np.sign(slope)[:, None] + 10 * np.sign(push)[:, None] * (time >= 0.2)
    launches = Launches(time, np.zeros((n, k, 1)), np.repeat(actions[..., None], 3, 2), slope,
                        push, end)  # fmt: skip
    figure = feedback_figure(launches, CONFIG.residual)
    rising, _, falling, _ = figure.axes[0].lines
    cm = 6.0  # of an action forward of 1
    assert rising.get_label() == "rises ahead"
    assert rising.get_ydata()[:20].tolist() == pytest.approx([cm] * 20)
    assert falling.get_ydata()[:20].tolist() == pytest.approx([-cm] * 20)
    forward, _, backward, _ = figure.axes[3].lines
    after = forward.get_xdata() > 0
    assert (forward.get_ydata()[after] > 8 * cm).all()
    assert (backward.get_ydata()[after] < -8 * cm).all()
    assert (abs(forward.get_ydata()[~after]) <= cm + 1e-6).all()


def test_the_command_prints_and_draws(monkeypatch, capsys):
    monkeypatch.setattr(feedback, "SHIPPED", Path("shipped"))
    saved(LINEAR)
    run(FeedbackOptions(episodes=2, plot=Path("drawn")))
    assert "gyro.y" in capsys.readouterr().out
    assert Path("drawn/feedback_velocity.png").exists()
