"""PPO of Stable-Baselines3, set up to start exactly at the baseline."""

from __future__ import annotations

import warnings

import torch
from stable_baselines3 import PPO

from icub_jump_env.policy import NetworkPolicy

from .critic import PrivilegedPolicy
from .environment import acting_steps
from .options import TrainOptions
from .vec_env import JumpVecEnv


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
            policy_kwargs={"net_arch": list(ppo.hidden), **actor},
            seed=options.seed,
            device="cpu",
        )
    for parameter in model.policy.action_net.parameters():
        torch.nn.init.zeros_(parameter)
    # Not learned: a policy that lands with noise could fall without, and the reverse.
    model.policy.log_std.requires_grad_(False)
    return model


def set_noise(model: PPO, options: TrainOptions) -> None:
    """Set the exploration noise that belongs to the present number of steps."""
    first, last = options.ppo.log_std
    share = min(1.0, model.num_timesteps / options.timesteps)
    with torch.no_grad():
        model.policy.log_std.fill_(first + share * (last - first))


def freeze_policy(model: PPO, frozen: bool) -> None:
    """Whether updates leave the policy as it is and change the value function alone."""
    for part in (model.policy.mlp_extractor.policy_net, model.policy.action_net):
        part.requires_grad_(not frozen)


def export(model: PPO, options: TrainOptions, action_scale: float) -> NetworkPolicy:
    """The mean action of a model as a policy that needs no torch."""
    hidden = model.policy.mlp_extractor.policy_net
    linear = [m for m in (*hidden, model.policy.action_net) if isinstance(m, torch.nn.Linear)]
    layers = tuple(
        (layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in linear
    )
    return NetworkPolicy(
        options.input_names,
        layers,
        options.axes,
        action_scale,
        options.env.residual.axes,
        tuple(options.env.layout.scales),
    )
