"""PPO of Stable-Baselines3, set up to start exactly at the baseline."""

from __future__ import annotations

import math
import warnings

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from icub_jump_env.policy import NetworkPolicy

from .checkpoints import segment_seeds
from .critic import PrivilegedPolicy
from .environment import acting_steps
from .options import TrainOptions
from .vec_env import JumpVecEnv

WHITENING_EPISODES = 4
"""Of each environment."""
LEAST_SPREAD = 0.01
"""What varies less than this between the observations of the baseline is not magnified: the residual
itself, above all, which is zero there."""


class Whitening(BaseFeaturesExtractor):
    """Shifts and scales observations: those of the baseline get mean 0 and standard deviation 1.

    A lean of a degree, which decides a jump, is 0.02 in the observation, and lost among the rest.
    Not ``VecNormalize``: its statistics go on changing, and no checkpoint of a policy has them.

    Attributes:
        mean: (n,) of each entry.
        deviation: (n,) likewise.
        hidden_norm: Root mean square of the norm of the actor's last hidden layer, likewise.
    """

    def __init__(self, observation_space: spaces.Box) -> None:
        """Leave observations as they are."""
        (size,) = observation_space.shape
        super().__init__(observation_space, size)
        self.mean = torch.nn.Buffer(torch.zeros(size))
        self.deviation = torch.nn.Buffer(torch.ones(size))
        self.hidden_norm = torch.nn.Buffer(torch.ones(()))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Of observations (n, size)."""
        return (observations - self.mean) / self.deviation

    def measure(self, observations: torch.Tensor) -> None:
        """Take mean and deviation of observations (n, size)."""
        self.mean.copy_(observations.mean(dim=0))
        deviation = observations.std(dim=0)
        deviation[deviation < LEAST_SPREAD] = 1.0
        self.deviation.copy_(deviation)


def make_model(options: TrainOptions, env: JumpVecEnv) -> PPO:
    """The learner: its policy's output layer is zero, hence its mean action.

    Args:
        options: How to learn.
        env: Environments side by side.
    """
    ppo, privileged = options.ppo, options.critic == "world"
    actor = {"n_actor": len(options.input_names)} if privileged else {}
    with warnings.catch_warnings():
        # The last batch of a pass may be smaller than the others, which does no harm.
        warnings.filterwarnings("ignore", "You have specified a mini-batch", UserWarning)
        model = PPO(
            PrivilegedPolicy if privileged else "MlpPolicy",
            env,
            learning_rate=ppo.learning_rate,
            n_steps=ppo.episodes // options.jobs * acting_steps(options.env),
            batch_size=ppo.batch_size,
            n_epochs=ppo.epochs,
            gamma=ppo.gamma,
            gae_lambda=ppo.gae_lambda,
            clip_range=ppo.clip_range,
            target_kl=ppo.target_kl,
            use_sde=True,
            sde_sample_freq=acting_steps(options.env),
            policy_kwargs={
                "net_arch": {"pi": list(ppo.hidden), "vf": list(ppo.critic_hidden)},
                "features_extractor_class": Whitening,
                **actor,
            },
            seed=options.seed,
            device="cpu",
        )
    for parameter in model.policy.action_net.parameters():
        torch.nn.init.zeros_(parameter)
    # Not learned: a policy that lands with noise could fall without, and the reverse.
    model.policy.log_std.requires_grad_(False)
    return model


def whiten(model: PPO, options: TrainOptions) -> None:
    """Measure the observations of the baseline, and the hidden layer."""
    env, whitening = model.get_env(), model.policy.features_extractor
    assert isinstance(env, JumpVecEnv)
    assert isinstance(whitening, Whitening)
    env.reset_all(segment_seeds(options.seed, 0, env.num_envs))
    none = np.zeros((env.num_envs, *(env.action_space.shape or ())), np.float32)
    steps = WHITENING_EPISODES * acting_steps(options.env)
    seen = np.concatenate([env.step(none)[0] for _ in range(steps)])
    whitening.measure(torch.as_tensor(seen))
    with torch.no_grad():
        hidden = model.policy.mlp_extractor.forward_actor(whitening(torch.as_tensor(seen)))
        whitening.hidden_norm.copy_(hidden.square().sum(dim=1).mean().sqrt())


def set_noise(model: PPO, options: TrainOptions) -> float:
    """Set the exploration noise that belongs to the present number of steps.

    It is a multiple of the last hidden layer, another one in each episode: what is explored is
    a course of the whole launch, which the filter of the residual does not average away.

    Returns:
        Its standard deviation.
    """
    first, last = options.ppo.log_std
    share = min(1.0, model.num_timesteps / options.timesteps)
    deviation = math.exp(first + share * (last - first))
    whitening = model.policy.features_extractor
    assert isinstance(whitening, Whitening)
    with torch.no_grad():
        model.policy.log_std.fill_(math.log(deviation / whitening.hidden_norm.item()))
    return deviation


def freeze_policy(model: PPO, frozen: bool) -> None:
    """Whether updates leave the policy as it is and change the value function alone."""
    for part in (model.policy.mlp_extractor.policy_net, model.policy.action_net):
        part.requires_grad_(not frozen)


def export(model: PPO, options: TrainOptions, action_scale: float) -> NetworkPolicy:
    """The mean action of a model as a policy that needs no torch."""
    hidden = model.policy.mlp_extractor.policy_net
    linear = [m for m in (*hidden, model.policy.action_net) if isinstance(m, torch.nn.Linear)]
    layers = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in linear]
    whitening, n_actor = model.policy.features_extractor, len(options.input_names)
    assert isinstance(whitening, Whitening)
    (weight, bias), mean = layers[0], whitening.mean[:n_actor].numpy()
    weight = weight / whitening.deviation[:n_actor].numpy()
    layers[0] = weight, bias - weight @ mean
    return NetworkPolicy(
        options.input_names,
        tuple(layers),
        options.axes,
        action_scale,
        options.env.residual.axes,
        tuple(options.env.layout.scales),
    )
