"""PPO without the QP, as the other end of the scale: joint targets as actions, the same budget.

    python -m experiments.without_qp --jobs 2

In the launch the policy moves the targets of the joint servos around the crouch, both legs and arms
alike. Task, flight, landing, observation, reward and PPO are those of a residual.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from rich.console import Console
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.environment import LaunchEnv
from agents.options import SELECTION, TrainOptions
from agents.ppo import make_model, set_noise, whiten
from agents.vec_env import JumpVecEnv
from experiments.headroom import configuration
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.phases import Phase, PhaseController, Tick
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT
from icub_jump_env.evaluation.report.output import say
from icub_jump_env.planning.plan import JumpPlan
from icub_jump_env.robot.icub import posture

Array = NDArray[np.float64]

JOINTS = ("hip_pitch", "knee", "ankle_pitch", "torso_pitch", "shoulder_pitch")
"""That the policy moves; of legs and arms both sides."""
LARGEST = 1.2
"""By an action of 1 (rad): it stretches the knees from the crouch to the posture of the flight."""


class JointLaunch:
    """Moves the joints to targets, by the next of which they arrive."""

    def __init__(self, instead_of: PhaseController, dt: float, period: float) -> None:
        self._instead_of = instead_of  # which sets up the reference that is observed
        self._dt, self._period = dt, period
        self._now = self._rate = np.zeros(0)

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``."""
        self._instead_of.start(state, plan, time)
        self._now = state.joint_position.copy()
        self._rate = np.zeros_like(self._now)

    def go_to(self, target: Array, fastest: Array) -> None:
        """Move on to targets (n,) (rad), no faster than (n,) (rad/s)."""
        self._rate = np.clip((target - self._now) / self._period, -fastest, fastest)

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        self._now = self._now + self._dt * self._rate
        return Tick(JointCommand(self._rate, self._now), None)


class JointEnv(LaunchEnv):
    """The launch, whose actions are targets of the joints, from -1 to 1 around the crouch."""

    def __init__(self, config: JumpConfig, inputs: Sequence[str]) -> None:
        super().__init__(config, inputs, config.residual.axes)
        self._no_residual = np.zeros(self.action_space.shape or (), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(JOINTS),), np.float32)
        env = self.env
        controllers = env._controller._controllers
        self._launch = JointLaunch(
            controllers[Phase.LAUNCH],
            1.0 / config.controller_config.frequency,
            1.0 / config.agent_frequency,
        )
        controllers[Phase.LAUNCH] = self._launch
        self._moves = np.stack([posture(**{name: math.degrees(1.0)}) for name in JOINTS], axis=1)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, ...]:
        """As of :class:`LaunchEnv`, with joint targets for the residual."""
        robot = self.env.robot
        target = robot.crouch + self._moves @ (LARGEST * np.clip(action, -1.0, 1.0))
        within = np.clip(target, robot.lower_position, robot.upper_position)
        self._launch.go_to(within, robot.velocity_limit)
        return super().step(self._no_residual)


@dataclass(frozen=True)
class WithoutOptions:
    """Train a policy that moves the joints itself.

    Attributes:
        jobs: Environments side by side.
        timesteps: Steps to learn from.
        seeds: How many trainings, from seed 0 on.
    """

    jobs: int = 2
    timesteps: int = 150_000
    seeds: int = 3

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, 64, "processes")
        check_count("timesteps", self.timesteps, 1, 10_000_000, "steps")
        check_count("seeds", self.seeds, 1, 100)


class _Noise(BaseCallback):
    """The exploration noise of ``train.py``."""

    def __init__(self, options: TrainOptions) -> None:
        super().__init__()
        self._options = options

    def _on_rollout_start(self) -> None:
        assert isinstance(self.model, PPO)
        set_noise(self.model, self._options)

    def _on_step(self) -> bool:
        return True


def learn(options: TrainOptions) -> list[dict[str, Any]]:
    """Train, and the last ``info`` of an episode with each seed of the selection."""
    make = partial(JointEnv, options.env, options.input_names)
    with contextlib.closing(JumpVecEnv([make] * options.jobs)) as envs:
        model = make_model(options, envs)
        whiten(model, options)
        model.learn(options.timesteps, callback=_Noise(options))
    with contextlib.closing(make()) as env:
        return [play(model, env, seed) for seed in SELECTION]


def play(model: PPO, env: JointEnv, seed: int) -> dict[str, Any]:
    """An episode without exploration, to its end."""
    observation, info = env.reset(seed=seed)
    ends = False
    while not ends:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, ends, _, info = env.step(action)
    return info


def run(options: WithoutOptions) -> None:
    """Train and print."""
    console = Console()
    for controller, seed in itertools.product(CONTROLLERS, range(options.seeds)):
        env = configuration("ICubJump-v1", "disturbed", controller, lean_correction=False)
        training = TrainOptions(env=env, jobs=options.jobs, timesteps=options.timesteps, seed=seed)
        infos = learn(training)
        success = np.mean([info["is_success"] for info in infos])
        rise = np.median([info["jump"]["flight_height"] for info in infos])
        say(
            console,
            f"{controller} actuators, seed {seed}, {options.timesteps} steps: "
            f"success {PERCENT * success:.0f} %, median rise {CM * rise:.1f} cm",
        )


if __name__ == "__main__":
    guarded(lambda: run(parse(WithoutOptions, sys.argv[1:])))
