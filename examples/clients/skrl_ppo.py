# /// script
# dependencies = ["skrl[torch]"]
# ///
"""PPO of skrl, with models of one's own."""

from typing import Any

import gymnasium
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer
from torch import nn

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}


class Policy(GaussianMixin, Model):
    """Mean and noise of the action."""

    def __init__(self, **spaces: Any) -> None:
        Model.__init__(self, **spaces)
        GaussianMixin.__init__(self, clip_actions=True)
        self.mean = nn.Linear(self.num_observations, self.num_actions)
        self.log_std = nn.Parameter(torch.full((self.num_actions,), -1.0))

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[torch.Tensor, dict[str, Any]]:
        """Of an observation."""
        return self.mean(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    """What is still to be gained."""

    def __init__(self, **spaces: Any) -> None:
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.value = nn.Linear(self.num_observations, 1)

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[torch.Tensor, dict[str, Any]]:
        """Of an observation."""
        return self.value(inputs["observations"]), {}


env = wrap_env(gymnasium.make("icub_jump_env:ICubJump-v1", **TASK))
spaces = {
    "observation_space": env.observation_space,
    "state_space": env.state_space,
    "action_space": env.action_space,
    "device": env.device,
}
agent = PPO(
    models={"policy": Policy(**spaces), "value": Value(**spaces)},
    memory=RandomMemory(memory_size=512, num_envs=1, device=env.device),
    cfg=PPO_CFG(
        rollouts=512,
        discount_factor=0.999,
        experiment={"write_interval": 0, "checkpoint_interval": 0},
    ),
    **spaces,
)
quiet = {"headless": True, "disable_progressbar": True, "close_environment_at_exit": False}
SequentialTrainer(env=env, agents=agent, cfg={"timesteps": 1024, **quiet}).train()
env.close()
print("1024 steps learned")
