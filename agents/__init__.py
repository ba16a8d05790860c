"""Agents that shift the CoM reference: the baseline, and a residual learned with PPO.

Whatever acts is an :class:`icub_jump_env.policy.Policy`, with or without torch: the pure
controller is ``Baseline``, a trained residual what ``load_policy`` reads. This package
trains them.
"""

from icub_jump_env.policy import Baseline, Policy, load_policy

__all__ = ["Baseline", "Policy", "load_policy"]
