"""Policies: from an observation to an action, and on disk."""

from icub_jump_env.policy.card import PolicyCard, check_match
from icub_jump_env.policy.network import NetworkPolicy
from icub_jump_env.policy.protocol import Policy
from icub_jump_env.policy.replay import ReplayPolicy
from icub_jump_env.policy.saving import load_policy, save_policy, shipped_policies
from icub_jump_env.policy.simple import BASELINE, Baseline

__all__ = [
    "BASELINE",
    "Baseline",
    "NetworkPolicy",
    "Policy",
    "PolicyCard",
    "ReplayPolicy",
    "check_match",
    "load_policy",
    "save_policy",
    "shipped_policies",
]
