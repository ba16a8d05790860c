"""When the residual acts: in the launch, or in all phases."""

import numpy as np
import pytest
from conftest import ZERO, jump

from icub_jump_env import JumpConfig
from icub_jump_env.control.phases import Phase
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.planning.residual import RESIDUAL_TIME
from icub_jump_env.robot.kinematics import FeetFixedKinematics

SHIFT = np.array([0.4, 0.2, -0.5], np.float32)


def after_the_launch(action, phases, stand_time=0.4, **changes):
    """Observations and costs of an episode whose launch is the baseline's."""
    env = make_env(JumpConfig().replace(stand_time=stand_time, residual_phases=phases, **changes))
    env.reset(seed=0)
    observations, costs, terminated, phase = [], [], False, "launch"
    while not terminated:
        acting = ZERO if phase == "launch" else action
        observation, _, terminated, _, info = env.step(acting)
        if phase != "launch":
            observations.append(observation)
            costs.append(info["reward_residual"])
        phase = info["phase"]
    env.close()
    return np.array(observations), costs


def test_without_residual_the_phases_make_no_difference():
    assert jump(residual_phases="all") == jump(residual_phases="launch")


def test_in_the_launch_alone_later_actions_do_and_cost_nothing():
    without, _ = after_the_launch(ZERO, "launch")
    shifted, costs = after_the_launch(SHIFT, "launch")
    assert (shifted == without).all()
    assert set(costs) == {0.0}


def test_in_all_phases_later_actions_move_the_robot_and_cost():
    without, _ = after_the_launch(ZERO, "all")
    shifted, costs = after_the_launch(SHIFT, "all")
    assert len(without) > 0
    assert not (shifted[-1] == without[-1]).all()
    assert costs == pytest.approx([-0.001 * float(SHIFT @ SHIFT)] * len(costs))


def test_the_posture_follows_the_residual_to_the_shift_of_the_com():
    """At rest the joints have moved as far as it takes to shift the CoM over resting feet."""
    env = make_env(JumpConfig().replace(residual_phases="all"))
    env.reset(seed=0)
    controller, state = env._controller, env._state
    for tick, force in enumerate((0.0, 0.0, 150.0)):
        state.foot_force = np.full(2, force)
        controller.tick(state, 0.005 * tick, np.zeros(5))
    assert controller.phases.phase is Phase.LANDING
    commands = []
    for target in (np.zeros(5), np.array([0.01, 0.004, -0.01, 0.0, 0.0])):
        for count in range(400):
            tick = controller.tick(state, 1.0 + 0.005 * count, target)
        commands.append(tick.command.position.copy())
    kinematics = FeetFixedKinematics(env.robot)
    coms = []
    for posture in commands:
        kinematics.update(posture)
        coms.append(kinematics.com.copy())
    assert coms[1] - coms[0] == pytest.approx([0.01, 0.004, -0.01], abs=5e-4)
    env.close()


def test_in_all_phases_the_residual_ends_with_the_landing():
    _, costs = after_the_launch(SHIFT, "all", stand_time=1.5)
    steps = round(RESIDUAL_TIME / 0.01)
    assert sum(cost < 0.0 for cost in costs) == pytest.approx(steps, abs=1)
    assert set(costs[steps + 1 :]) == {0.0}


def test_a_posture_chosen_by_feedback_and_then_held_takes_no_residual():
    """Nothing on the ground follows it, so it costs nothing there."""
    changes = {"estimator": "imu", "flight": "feedback"}
    _, held = after_the_launch(SHIFT, "all", **changes)
    _, caught = after_the_launch(SHIFT, "all", landing="feedback", **changes)
    in_flight = sum(cost < 0.0 for cost in held)
    assert 5 < in_flight < 30
    assert set(held[in_flight:]) == {0.0}
    assert sum(cost < 0.0 for cost in caught) > in_flight + 20
