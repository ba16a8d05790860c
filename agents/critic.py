"""A critic that sees more than the actor: the world and the true state, in training alone."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from torch import Tensor


class PrivilegedExtractor(MlpExtractor):
    """Hidden layers of actor and critic, of which the actor has the first inputs alone."""

    def __init__(self, n_actor: int, n_inputs: int, *arguments: Any, **others: Any) -> None:
        """Set up the layers.

        Args:
            n_actor: Inputs of the actor.
            n_inputs: Inputs of the critic, which begin with those of the actor.
            arguments: As of ``MlpExtractor``, but for the number of inputs.
            others: Likewise.
        """
        super().__init__(n_inputs, *arguments, **others)
        actor = MlpExtractor(n_actor, *arguments, **others)
        self.policy_net, self._n_actor = actor.policy_net, n_actor
        self.latent_dim_pi = actor.latent_dim_pi

    def forward_actor(self, features: Tensor) -> Tensor:
        """Of the actor's inputs."""
        return super().forward_actor(features[:, : self._n_actor])


class PrivilegedPolicy(ActorCriticPolicy):
    """Stable-Baselines3's policy with a :class:`PrivilegedExtractor`."""

    def __init__(self, *arguments: Any, n_actor: int, **others: Any) -> None:
        """Set up the policy; ``n_actor`` is the number of the actor's inputs."""
        self._n_actor = n_actor
        super().__init__(*arguments, **others)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = PrivilegedExtractor(
            self._n_actor,
            self.features_dim,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return super()._get_constructor_parameters() | {"n_actor": self._n_actor}
