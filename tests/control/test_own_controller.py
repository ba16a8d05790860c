"""A controller of the user's own: what it decides is done, and no file says that it was ours."""

from dataclasses import dataclass

import numpy as np
import pytest

from icub_jump_env import VelocityConfig
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import ControllerConfig
from icub_jump_env.control.qp.problem import IDLE
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.export.dataset import write_dataset
from icub_jump_env.policy import NetworkPolicy, save_policy
from icub_jump_env.policy.simple import BASELINE


class Knees:
    """Moves the knees alone."""

    report = IDLE

    def __init__(self, speed, kinematics):
        self.velocity = np.zeros(kinematics.robot.n_joints)
        self.velocity[kinematics.robot.joint_names.index("l_knee")] = speed

    def reset(self, stance):
        """Nothing to forget."""

    def command(self, state, setpoint):
        return JointCommand(velocity=self.velocity)


@dataclass(frozen=True, kw_only=True)
class KneesConfig(VelocityConfig):
    def make(self, kinematics):
        return Knees(-0.1 * self.com, kinematics)


CONFIG = JumpConfig.of(controller=KneesConfig(com=2.0), stand_time=0.1)


def test_the_servos_get_what_it_decides():
    trace = run_episode(make_env(traced(CONFIG)), 0, trace=True).trace
    joint = CONFIG.robot_value.joint_names.index("l_knee")
    commanded = np.array([s.joint_velocity_command for s in trace if s.phase == "launch"][1:])
    assert (commanded[:, joint] == -0.2).all()
    assert not np.delete(commanded, joint, axis=1).any()


def test_its_episodes_are_logged_apart_from_ours():
    ours = CONFIG.replace(controller=VelocityConfig(com=2.0))
    assert Series(CONFIG, range(2)).default_log() != Series(ours, range(2)).default_log()


def test_no_file_holds_it(tmp_path):
    with pytest.raises(ConfigError, match="controller='KneesConfig' is not allowed"):
        write_dataset("icub/jump/knees-v0", CONFIG, BASELINE, [0], "knees")
    still = NetworkPolicy((), ((np.zeros((3, 0), np.float32), np.zeros(3, np.float32)),))
    with pytest.raises(ConfigError, match="controller='KneesConfig' is not allowed"):
        save_policy(
            tmp_path / "p.safetensors",
            still,
            config=CONFIG,
            versions={},
            command=(),
            seed=None,
            results={},
        )
    assert not list(tmp_path.iterdir())


def test_it_is_one_of_the_two_kinds():
    """Plans and log names depend on which."""

    @dataclass(frozen=True, kw_only=True)
    class Third(ControllerConfig):
        frequency: float = 200.0

    with pytest.raises(ConfigError, match="controller"):
        JumpConfig(controller=Third())
