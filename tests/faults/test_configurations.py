"""Any configuration is taken or refused by a typed error; one that is taken jumps."""

import contextlib
import dataclasses
import math
from typing import get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import (
    CommandNotScalableError,
    ConfigError,
    HeightNotReachableError,
    PlanningError,
)
from icub_jump_env.shortcuts import Shortcuts

NOT_DRAWN = {"mode", "render_mode", "robot", "plans"}
"""Windows, models of other robots and files; they have tests of their own."""

absurd = st.sampled_from(
    [0.0, -0.0, 1e-300, 1e300, math.inf, -math.inf, math.nan, -1, 10**400, np.float32(0.05), True]
)
whatever = st.recursive(
    st.none() | absurd | st.floats() | st.integers() | st.text(max_size=4) | st.just(object()),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=2)
    ),
    max_leaves=4,
)


def plausible(hint, default):
    """Values of a field, most of which are in its range."""
    options = (hint, *get_args(hint))
    groups = [option for option in options if dataclasses.is_dataclass(option)]
    if groups:
        return st.one_of(*(fields_of(group) for group in groups)) | names_in(options)
    if isinstance(default, bool):
        return st.booleans()
    if isinstance(default, int):
        return st.integers(default, default + 3)
    if isinstance(default, float):
        return st.floats(0.7, 1.4).map(lambda factor: factor * default)
    if isinstance(default, tuple) and default and isinstance(default[0], float):
        return st.tuples(*(plausible(float, value) for value in default))
    return st.just(default) | names_in(options)


def names_in(options):
    """Names that a field may have."""
    names = [name for option in options for name in get_args(option) if isinstance(name, str)]
    return st.sampled_from(names) if names else st.nothing()


def fields_of(kind, *more):
    """Some fields of a dataclass, and of others."""
    drawn = {}
    for group in (kind, *more):
        default = group()
        for name, hint in get_type_hints(group).items():
            if name not in NOT_DRAWN and hasattr(default, name):
                drawn[name] = plausible(hint, getattr(default, name)) | whatever
    return st.sets(st.sampled_from(sorted(drawn)), max_size=3).flatmap(
        lambda names: st.fixed_dictionaries({name: drawn[name] for name in sorted(names)})
    )


@pytest.mark.fault("configurations")
@given(fields_of(JumpConfig, Shortcuts))
def test_any_configuration_is_taken_or_refused(keywords):
    refusal = None
    try:
        config = JumpConfig.of(**keywords)
    except ConfigError as error:
        refusal = str(error)
    if refusal is None:
        assert dataclasses.replace(config) == config
    else:
        assert refusal.isprintable()
        assert len(refusal) <= 2000


OUT_OF_REACH = (CommandNotScalableError, HeightNotReachableError, PlanningError)


@pytest.mark.fault("configurations that are taken")
@given(fields_of(JumpConfig, Shortcuts))
def test_what_is_taken_jumps(keywords):
    try:
        config = JumpConfig.of(**keywords)
    except ConfigError:
        reject()
    env = ICubJumpEnv(**vars(config))
    env.action_space.seed(0)
    with contextlib.closing(env), contextlib.suppress(*OUT_OF_REACH):
        env.reset(seed=0)
        for _ in range(3):
            observation, reward, *_ = env.step(env.action_space.sample())
            assert observation in env.observation_space
            assert math.isfinite(reward)
