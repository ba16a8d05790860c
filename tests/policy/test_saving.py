"""Policies on disk: they come back to the bit, or not at all."""

import hashlib
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from policies import DETAILS, POLICIES, make_network, make_replay, random_observation
from safetensors.numpy import load, save

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import (
    ConfigError,
    ICubJumpError,
    PolicyFileError,
    PolicyMismatchError,
)
from icub_jump_env.observation import DEFAULT
from icub_jump_env.policy import ReplayPolicy, load_policy, save_policy, shipped_policies
from icub_jump_env.policy.fields import MAX_HIDDEN, MAX_WIDTH
from icub_jump_env.policy.replay import MAX_COMMANDS, MAX_STEPS
from icub_jump_env.policy.saving import MAX_POLICY_SIZE, SHIPPED


@pytest.fixture(params=POLICIES)
def policy(request):
    return POLICIES[request.param]


@pytest.fixture
def path(tmp_path, policy):
    """The policy on disk."""
    path = tmp_path / "jump.safetensors"
    save_policy(path, policy, **DETAILS)
    return path


def rewrite(path, tensors=None, **changes):
    """Forge a pair whose hash fits."""
    content = path.read_bytes() if tensors is None else save(tensors)
    path.write_bytes(content)
    card = json.loads(path.with_suffix(".json").read_text())
    card |= {"sha256": hashlib.sha256(content).hexdigest()} | changes
    path.with_suffix(".json").write_text(json.dumps(card))


def test_round_trip_to_the_bit(path, policy, rng):
    observations = [random_observation(rng) for _ in range(50)]
    for name in (path, str(path), path.with_suffix(".json")):
        loaded = load_policy(name, JumpConfig())
        for obs in observations:
            assert loaded(obs).tobytes() == policy(obs).tobytes()
        assert loaded.card.kind == policy.kind
        assert loaded.card.config == DETAILS["config"]
        assert loaded.card.seed == 3
        assert loaded.card.command == ("python", "train.py", "--seed", "3")
        assert loaded.card.results["success"]["interval"] == (0.77, 0.88)
        assert loaded.card.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_saved_again_the_files_are_the_same(path):
    loaded = load_policy(path)
    again = path.with_name("again.json")
    card = loaded.card
    save_policy(
        again,
        loaded.policy,
        config=card.config,
        versions=card.versions,
        command=card.command,
        seed=card.seed,
        results=card.results,
    )
    assert again.read_bytes() == path.with_suffix(".json").read_bytes()
    assert again.with_suffix(".safetensors").read_bytes() == path.read_bytes()


def test_the_largest_policies_can_be_read(tmp_path):
    network = make_network(tuple(DEFAULT.scales), (MAX_WIDTH,) * MAX_HIDDEN)
    table = ReplayPolicy(
        np.linspace(0.01, 0.15, MAX_COMMANDS, dtype=np.float32),
        np.zeros((MAX_COMMANDS, MAX_STEPS, 3), np.float32),
        100.0,
    )
    for policy in (network, table):
        path = tmp_path / "large.safetensors"
        save_policy(path, policy, **DETAILS)
        assert path.stat().st_size <= MAX_POLICY_SIZE
        load_policy(path)


def test_a_file_beyond_the_limit_is_refused(path):
    with path.open("ab") as file:
        file.truncate(MAX_POLICY_SIZE + 1)
    with pytest.raises(PolicyFileError, match=f"larger than {MAX_POLICY_SIZE} bytes"):
        load_policy(path)


def test_another_environment_is_refused(path):
    other = JumpConfig.of(controller="torque", ankle_shift=False, randomization="full")
    load_policy(path)
    with pytest.raises(PolicyMismatchError) as error:
        load_policy(path, other)
    names = {name for name, _, _ in error.value.differences}
    assert names == {"controller", "control_frequency", "ankle_shift"}
    assert "controller='torque' instead of 'velocity'" in str(error.value)


def test_another_layout_is_named_even_if_inputs_are_gone(path):
    entries = {**DEFAULT.scales, "wind": 1.0}
    rewrite(path, observation=list(entries.items()), inputs=["wind"])
    with pytest.raises(PolicyMismatchError, match=r"observation\.wind=None instead of 1\.0"):
        load_policy(path, JumpConfig())
    with pytest.raises(PolicyMismatchError, match=r"observation\.wind"):
        load_policy(path)


def test_replay_at_another_rate_than_the_environments(tmp_path):
    with pytest.raises(ConfigError, match=r"agent_frequency=50\.0 .* 100\.0"):
        save_policy(tmp_path / "a.json", make_replay(frequency=50.0), **DETAILS)
    details = DETAILS | {"config": JumpConfig.of(agent_frequency=50.0)}
    save_policy(tmp_path / "a.json", make_replay(frequency=50.0), **details)
    assert load_policy(tmp_path / "a.json").policy.agent_frequency == 50.0


def test_only_these_policies_can_be_saved(tmp_path):
    with pytest.raises(ConfigError, match="NetworkPolicy"):
        save_policy(tmp_path / "a.json", lambda obs: obs[:3], **DETAILS)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("network", {"inputs": ["gyro.y", "time"]}),
        ("network", {"inputs": ["gyro.y", "phase.launch", "time", "gyro.x"]}),
        ("network", {"hidden": [7]}),
        ("network", {"hidden": [4, 7]}),
        ("network", {"hidden": [7, 4, 1]}),
        ("network", {"axes": ["forward", "lateral", "vertical"]}),
        ("network", {"axes": ["lateral"]}),
        ("network", {"kind": "replay"}),
        ("network", {"format": 2}),
        ("network", {"config": {"jump_height": 9}}),
        ("network", {"extra": 1}),
        ("constant", {"inputs": ["gyro.y"]}),
        ("constant", {"hidden": [1]}),
        ("replay", {"kind": "network"}),
        ("replay", {"inputs": ["jump_height", "time"]}),
        ("replay", {"hidden": [3]}),
        ("replay", {"axes": ["forward"]}),
        ("replay", {"action_scale": 0.5}),
    ],
)
@pytest.mark.fault("hostile policies")
def test_a_card_that_contradicts_the_arrays(tmp_path, name, change):
    path = tmp_path / "jump.safetensors"
    save_policy(path, POLICIES[name], **DETAILS)
    rewrite(path)
    load_policy(path)
    rewrite(path, **change)
    with pytest.raises(PolicyFileError, match=r"jump\.safetensors: .* is not allowed"):
        load_policy(path)


@pytest.mark.fault("hostile policies")
def test_forged_arrays_are_refused(path):
    original = load(path.read_bytes())
    name = next(iter(original))
    array = original[name]
    forgeries = [
        {},
        {key: value for key, value in original.items() if key != name},
        original | {"extra": np.zeros(1, np.float32)},
        original | {"layers.9.weight": np.zeros((1, 1), np.float32)},
        original | {name: array.astype(np.float64)},
        original | {name: array.astype(np.float16)},
        original | {name: array[None]},
        original | {name: array.reshape(-1)[:-1]},
        original | {name: np.zeros((2**40, 0), np.float32)},
        original | {key: np.full_like(value, np.nan) for key, value in original.items()},
        original | {key: np.full_like(value, np.inf) for key, value in original.items()},
        original | {key: np.full_like(value, 1e30) for key, value in original.items()},
    ]
    for tensors in forgeries:
        rewrite(path, tensors)
        with pytest.raises(PolicyFileError, match=r"jump\.safetensors: "):
            load_policy(path)
    rewrite(path, original)
    load_policy(path)


@given(
    key=st.sampled_from(["kind", "inputs", "hidden", "axes", "action_scale", "config", "format"]),
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
        max_leaves=6,
    ),
)
@pytest.mark.fault("hostile policies")
def test_hostile_cards_lead_to_typed_errors(tmp_path_factory, key, value):
    path = tmp_path_factory.mktemp("policy") / "jump.safetensors"
    save_policy(path, POLICIES["network"], **DETAILS)
    rewrite(path, **{key: value})
    try:
        action = load_policy(path, JumpConfig())(np.ones(80, np.float32))
        assert (np.abs(action) <= 1.0).all()
    except ICubJumpError:
        pass


KINDS = {"": "network", "-constant": "network", "-open-loop": "replay"}


def test_the_shipped_policies_are_those_of_both_controllers():
    assert shipped_policies() == [
        "disturbed-torque",
        "disturbed-velocity",
        *(f"{controller}{kind}" for controller in ("torque", "velocity") for kind in KINDS),
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("controller", ["torque", "velocity"])
def test_a_shipped_policy_is_read_by_its_name(controller, kind, rng):
    name = f"{controller}{kind}"
    loaded = load_policy(name)
    file = SHIPPED / f"{name}.safetensors"
    assert loaded.card == load_policy(file).card
    assert loaded.card.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert loaded.card.kind == KINDS[kind]
    assert loaded.card.config.controller_name == controller
    obs = random_observation(rng)
    assert loaded(obs).tobytes() == load_policy(file)(obs).tobytes()
    assert loaded(obs).any()
    load_policy(name, loaded.card.config)
    with pytest.raises(PolicyMismatchError, match="ankle_shift"):
        load_policy(name, loaded.card.config.replace(ankle_shift=False))


@pytest.mark.parametrize("name", ["spring", "torque2", "../shipped/torque", ""])
def test_another_name_is_that_of_a_file(name):
    with pytest.raises(PolicyFileError):
        load_policy(name)
