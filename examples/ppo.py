# /// script
# dependencies = ["torch"]
# ///
"""PPO in one file: what it takes to learn a residual, without a library for it (torch alone).

    python examples/ppo.py --steps 150000 --seed 0

writes the trained policy to runs/ppo/policy.safetensors, for `python eval.py --policy ...`. What it lacks
beside train.py: noise that lasts, a critic that sees the world, checkpoints, evaluations that choose the best policy.

Schulman et al., Proximal Policy Optimization Algorithms, 2017; advantages by Schulman et al., High-Dimensional
Continuous Control Using Generalized Advantage Estimation, 2015.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

from icub_jump_env import JumpConfig
from icub_jump_env.policy import NetworkPolicy, save_policy

CONFIG = JumpConfig.of(
    jump_height=(0.04, 0.08), com_displacement=0.09, randomization="hard", early_end=True
)
ENVS, STEPS = 4, 512  # side by side, and of each between two updates
GAMMA, LAMBDA = 0.999, 0.98  # most of the reward comes with the last step
CLIP, EPOCHS, BATCH, RATE = 0.2, 10, 256, 5e-4


class Agent(nn.Module):
    """Mean action and value of an observation; the noise does not depend on it."""

    def __init__(self, inputs: int, actions: int) -> None:
        super().__init__()
        self.mean = nn.Sequential(nn.Linear(inputs, 32), nn.Tanh(), nn.Linear(32, actions))
        self.value = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 1))
        self.log_std = nn.Parameter(torch.full((actions,), -1.0))
        nn.init.zeros_(self.mean[2].weight)  # the first policy is the controller alone
        nn.init.zeros_(self.mean[2].bias)

    def distribution(self, observation: torch.Tensor) -> Normal:
        """Of the action."""
        return Normal(self.mean(observation), self.log_std.exp())


class Rollout(NamedTuple):
    """Steps of all environments, one after the other: (k * ENVS, ...) each."""

    seen: torch.Tensor
    done: torch.Tensor
    odds: torch.Tensor  # log-probability of what was done
    advantage: torch.Tensor
    target: torch.Tensor  # what the value should have been


def collect(
    agent: Agent, envs: gymnasium.vector.VectorEnv, observation: np.ndarray
) -> tuple[Rollout, np.ndarray, list[bool]]:
    """Steps with the present policy, the next observation, and how episodes went that ended."""
    steps, values, rewards, over, successes = [], [], [], [], []
    for _ in range(STEPS):
        seen = torch.as_tensor(observation)
        with torch.no_grad():
            choices = agent.distribution(seen)
            done = choices.sample()
            values.append(agent.value(seen).squeeze(1).numpy())
        steps.append((seen, done, choices.log_prob(done).sum(1)))
        observation, reward, terminated, truncated, info = envs.step(done.numpy())
        rewards.append(reward)
        over.append(terminated | truncated)
        if "final_info" in info:
            successes += info["final_info"]["is_success"][over[-1]].tolist()
    with torch.no_grad():
        following = agent.value(torch.as_tensor(observation)).squeeze(1).numpy()
    advantage, gathered = np.zeros((STEPS, ENVS)), np.zeros(ENVS)
    for step in reversed(range(STEPS)):
        alive = ~over[step]
        error = rewards[step] + GAMMA * alive * following - values[step]
        gathered = error + GAMMA * LAMBDA * alive * gathered
        advantage[step], following = gathered, values[step]
    numbers = (advantage.ravel(), (advantage + values).ravel())
    flat = (torch.as_tensor(each, dtype=torch.float32) for each in numbers)
    return Rollout(*map(torch.cat, zip(*steps, strict=True)), *flat), observation, successes


def improve(
    agent: Agent, optimizer: torch.optim.Optimizer, rollout: Rollout, rng: np.random.Generator
) -> None:
    """Some epochs on a rollout, not far from the policy that made it."""
    for _ in range(EPOCHS):
        for batch in np.array_split(rng.permutation(len(rollout.seen)), ENVS * STEPS // BATCH):
            seen, done, odds, advantage, target = (each[batch] for each in rollout)
            ratio = (agent.distribution(seen).log_prob(done).sum(1) - odds).exp()
            scaled = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            clipped = ratio.clamp(1.0 - CLIP, 1.0 + CLIP)
            gain = torch.min(ratio * scaled, clipped * scaled).mean()
            loss = (agent.value(seen).squeeze(1) - target).square().mean()
            optimizer.zero_grad()
            (0.5 * loss - gain).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def main() -> None:
    """Train, and save."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--steps", type=int, default=150_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(options.seed)

    envs = gymnasium.make_vec(
        "ICubJump-v0", num_envs=ENVS, autoreset_mode="SameStep", **vars(CONFIG)
    )
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimizer = torch.optim.Adam(agent.parameters(), lr=RATE)
    observation, _ = envs.reset(seed=options.seed)
    for update in range(max(1, options.steps // (ENVS * STEPS))):
        rollout, observation, successes = collect(agent, envs, observation)
        improve(agent, optimizer, rollout, rng)
        done = (update + 1) * ENVS * STEPS
        print(f"{done} steps: {sum(successes)} of {len(successes)} episodes succeed")
    envs.close()
    save(agent, Path("runs/ppo/policy.safetensors"), options.seed)


def save(agent: Agent, path: Path, seed: int) -> None:
    """Save the mean as a policy that needs no torch."""
    layers = [layer for layer in agent.mean if isinstance(layer, nn.Linear)]
    arrays = tuple(
        (layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in layers
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    policy = NetworkPolicy(tuple(CONFIG.layout.scales), arrays)
    save_policy(
        path,
        policy,
        config=CONFIG,
        versions={},
        command=("python", "examples/ppo.py"),
        seed=seed,
        results={},
    )
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
