"""Humanoid jumping with the iCub: a Gymnasium environment around two QP controllers.

Importing this package registers ``ICubJump-v0``, the paper's jump, and ``ICubJump-v1``, which
plans with the whole body and controls flight and landing by feedback::

    import gymnasium, icub_jump_env

    env = gymnasium.make("ICubJump-v1", jump_height=0.06)
"""

from __future__ import annotations

import gymnasium
import lazy_loader

from icub_jump_env.versions import MAX_EPISODE_STEPS, VERSIONS

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

for _name, _defaults in VERSIONS.items():
    gymnasium.register(
        id=_name,
        entry_point="icub_jump_env.env:ICubJumpEnv",
        vector_entry_point="icub_jump_env.vector:ICubJumpVectorEnv",
        max_episode_steps=MAX_EPISODE_STEPS,
        kwargs=dict(_defaults),
    )
