"""The forward pass against plain loops and against torch; refusals."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from policies import POLICIES, make_network, random_observation

from icub_jump_env import observation
from icub_jump_env.errors import ConfigError
from icub_jump_env.planning.residual import COM_AXES as AXES
from icub_jump_env.policy import Baseline, NetworkPolicy
from icub_jump_env.policy.fields import MAX_HIDDEN, MAX_WIDTH
from icub_jump_env.policy.network import WEIGHT_LIMIT

ENTRIES = [
    row.split("|")[2].strip().strip("`") for row in observation.layout_table().split("\n")[2:]
]
"""Names of the entries as the documentation has them."""


def by_hand(policy, obs):
    """The action in float64, one multiplication after the other."""
    values = [float(obs[ENTRIES.index(name)]) for name in policy.inputs]
    for number, (weight, bias) in enumerate(policy.layers):
        sums = []
        for row, offset in zip(weight.tolist(), bias.tolist(), strict=True):
            sums.append(offset + math.fsum(w * v for w, v in zip(row, values, strict=True)))
        last = number == len(policy.layers) - 1
        values = sums if last else [math.tanh(s) for s in sums]
    action = {"forward": 0.0, "lateral": 0.0, "vertical": 0.0}
    for axis, value in zip(policy.axes, values, strict=True):
        action[axis] = policy.action_scale * min(1.0, max(-1.0, value))
    return list(action.values())


def test_entries_have_the_names_of_the_documentation():
    assert list(observation.DEFAULT.scales) == ENTRIES
    assert len(set(ENTRIES)) == observation.SIZE == 80


@pytest.mark.parametrize("hidden", [(), (5,), (64, 64), (3, 1, 4, 2)])
@pytest.mark.parametrize("axes", [("forward",), ("forward", "vertical"), AXES])
def test_forward_pass_by_hand(rng, hidden, axes):
    inputs = ("joint_velocity.l_knee", "gyro.y", "jump_height", "phase.launch")
    policy = make_network(inputs, hidden, axes, 0.7)
    assert policy.hidden == hidden
    for _ in range(20):
        obs = random_observation(rng)
        obs[::2] /= 100.0
        action = policy(obs)
        assert action.dtype == np.float32
        assert action == pytest.approx(by_hand(policy, obs), abs=2e-4)


def test_forward_pass_against_torch(rng):
    torch = pytest.importorskip("torch")
    policy = make_network(tuple(ENTRIES), (64, 32))
    modules = []
    for weight, bias in policy.layers:
        linear = torch.nn.Linear(weight.shape[1], weight.shape[0])
        with torch.no_grad():
            linear.weight[:] = torch.tensor(weight)
            linear.bias[:] = torch.tensor(bias)
        modules += [linear, torch.nn.Tanh()]
    network = torch.nn.Sequential(*modules[:-1])
    for _ in range(20):
        obs = random_observation(rng) / 10
        with torch.no_grad():
            expected = network(torch.tensor(obs)).clamp(-1.0, 1.0).numpy()
        assert policy(obs) == pytest.approx(expected, abs=1e-4)


def test_each_input_is_the_entry_of_its_name():
    obs = np.linspace(-1, 1, 80).astype(np.float32)
    one = (np.ones((1, 1), np.float32), np.zeros(1, np.float32))
    for index, name in enumerate(ENTRIES):
        policy = NetworkPolicy((name,), (one,), ("vertical",), 1.0)
        assert policy(obs).tolist() == [0.0, 0.0, obs[index]]


@given(
    inputs=st.lists(st.sampled_from(ENTRIES), unique=True, max_size=6).map(tuple),
    hidden=st.lists(st.integers(1, 8), max_size=MAX_HIDDEN).map(tuple),
    chosen=st.sets(st.sampled_from(AXES), min_size=1),
    scale=st.floats(1e-3, 1.0),
    seed=st.integers(0, 1000),
)
def test_actions_are_bounded_and_on_their_axes(inputs, hidden, chosen, scale, seed):
    axes = tuple(axis for axis in AXES if axis in chosen)
    policy = make_network(inputs, hidden, axes, scale, seed)
    obs = random_observation(np.random.default_rng(seed))
    before = obs.copy()
    action = policy(obs)
    assert action.shape == (3,)
    assert action.dtype == np.float32
    assert (np.abs(action) <= np.float32(scale)).all()
    assert all(action[i] == 0.0 for i, axis in enumerate(AXES) if axis not in chosen)
    # No memory, no traces, and the caller's own array.
    action[:] = 7.0
    assert policy(obs).tobytes() == policy(obs).tobytes() != action.tobytes()
    assert (obs == before).all()


def test_the_scale_multiplies_what_was_clipped(rng):
    whole = make_network(("time", "gyro.x"), (4,), AXES, 1.0)
    small = NetworkPolicy(whole.inputs, whole.layers, AXES, 0.25)
    for _ in range(20):
        obs = random_observation(rng)
        assert (small(obs) == np.float32(0.25) * whole(obs)).all()


def test_clipping_at_both_ends():
    for bias, expected in ((5.0, 1.0), (-5.0, -1.0), (0.5, 0.5)):
        layer = (np.zeros((1, 0), np.float32), np.array([bias], np.float32))
        assert NetworkPolicy((), (layer,), ("lateral",))(np.zeros(80, np.float32))[1] == expected


def test_the_largest_weights_give_finite_actions():
    n = MAX_WIDTH
    sign = np.where(np.arange(n) % 2, 1.0, -1.0).astype(np.float32) * np.float32(WEIGHT_LIMIT)
    layers = (
        (np.tile(sign[:80], (n, 1)), sign),
        (np.tile(sign, (n, 1)), sign),
        (np.tile(sign, (3, 1)), sign[:3]),
    )
    policy = NetworkPolicy(tuple(ENTRIES), layers)
    assert np.isfinite(policy(np.full(80, 10.0, np.float32))).all()
    assert np.isfinite(policy(np.tile(np.float32([10, -10]), 40))).all()


def test_baseline_is_zero(rng):
    for obs in (random_observation(rng), np.full(80, np.nan, np.float32)):
        assert Baseline()(obs).tobytes() == np.zeros(3, np.float32).tobytes()
        assert Baseline()(obs).dtype == np.float32
    Baseline()(obs)[:] = 1.0
    assert not Baseline()(obs).any()


def test_later_changes_of_the_weights_do_not_reach_the_policy():
    weight, bias = np.ones((1, 1), np.float32), np.zeros(1, np.float32)
    policy = NetworkPolicy(("time",), ((weight, bias),), ("forward",))
    weight[:] = np.nan
    assert policy(np.ones(80, np.float32)).tolist() == [1.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="read-only"):
        policy.layers[0][0][:] = 1.0


def test_layout_of_the_memory_does_not_matter(rng):
    policy = make_network(("time", "gyro.x", "gyro.y"), (4,))
    turned = tuple((np.asfortranarray(w), np.repeat(b, 2)[::2]) for w, b in policy.layers)
    other = NetworkPolicy(policy.inputs, turned)
    obs = random_observation(rng)
    assert other(obs).tobytes() == policy(obs).tobytes()


@pytest.mark.parametrize("policy", POLICIES.values(), ids=POLICIES)
def test_pickled_for_workers(policy, rng):
    obs = random_observation(rng)
    assert pickle.loads(pickle.dumps(policy))(obs).tobytes() == policy(obs).tobytes()


def layer(n_out, n_in, dtype=np.float32, value=0.0):
    return np.full((n_out, n_in), value, dtype), np.zeros(n_out, dtype)


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("inputs", {"inputs": ("speed",)}),
        ("inputs", {"inputs": "time"}),
        ("inputs", {"inputs": (3,)}),
        ("inputs", {"inputs": (["time"],)}),
        ("inputs", {"inputs": ("time", "time")}),
        ("axes", {"axes": ()}),
        ("axes", {"axes": ("vertical", "forward")}),
        ("axes", {"axes": ("forward", "forward")}),
        ("axes", {"axes": "forward"}),
        ("axes", {"axes": ("up",)}),
        ("action_scale", {"action_scale": 0.0}),
        ("action_scale", {"action_scale": 1.1}),
        ("action_scale", {"action_scale": math.nan}),
        ("action_scale", {"action_scale": "1"}),
        ("number of layers", {"layers": ()}),
        ("number of layers", {"layers": (layer(1, 1),) * (MAX_HIDDEN + 2)}),
        ("hidden", {"layers": (layer(MAX_WIDTH + 1, 1), layer(1, MAX_WIDTH + 1))}),
        ("hidden", {"layers": (layer(0, 1), layer(1, 0))}),
        ("layers.0.weight", {"layers": (layer(1, 2),)}),
        ("layers.0.weight", {"layers": (layer(2, 1),)}),
        ("layers.1.weight", {"layers": (layer(4, 1), layer(1, 3))}),
        ("layers.0.weight", {"layers": (layer(1, 1, np.float64),)}),
        ("layers.0.weight", {"layers": (([[1.0]], np.zeros(1, np.float32)),)}),
        ("layers.0.bias", {"layers": ((layer(1, 1)[0], np.zeros((1, 1), np.float32)),)}),
        ("layers.0.bias", {"layers": ((layer(1, 1)[0], np.array([np.nan], np.float32)),)}),
        ("layers.0.weight", {"layers": (layer(1, 1, value=np.nan),)}),
        ("layers.0.weight", {"layers": (layer(1, 1, value=-np.inf),)}),
        ("layers.0.weight", {"layers": (layer(1, 1, value=2 * WEIGHT_LIMIT),)}),
    ],
)
def test_refusals_name_the_field(field, change):
    values = {
        "inputs": ("time",),
        "layers": (layer(1, 1),),
        "axes": ("forward",),
        "action_scale": 1.0,
    }
    NetworkPolicy(**values)
    with pytest.raises(ConfigError) as error:
        NetworkPolicy(**(values | change))
    assert error.value.field == field
