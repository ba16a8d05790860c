"""Policies as ONNX: another runtime computes the same actions from them."""

import itertools
import json

import numpy as np
import onnxruntime
import pytest

from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.export.onnx_policy import write_onnx
from icub_jump_env.policy import NetworkPolicy, load_policy, save_policy


def network(rng, config, hidden):
    """A random one, of some inputs, for some axes in another place than theirs."""
    entries = tuple(config.layout.scales)
    inputs = tuple(rng.choice(entries, 7, replace=False))
    widths = (7, *hidden, 2)
    layers = tuple(
        (rng.normal(size=(m, n)).astype(np.float32), rng.normal(size=m).astype(np.float32))
        for n, m in itertools.pairwise(widths)
    )
    return NetworkPolicy(inputs, layers, ("forward", "vertical"), 0.7, entries=entries)


@pytest.mark.parametrize("hidden", [(), (5,), (8, 4)])
def test_onnxruntime_acts_as_the_policy_does(tmp_path, rng, hidden):
    config = load_policy("velocity").card.config
    save_policy(
        tmp_path / "p.safetensors", network(rng, config, hidden), config=config, versions={},
        command=("x",), seed=None, results={},
    )  # fmt: skip
    policy = load_policy(tmp_path / "p.safetensors")
    write_onnx(policy, tmp_path / "p.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "p.onnx")
    observations = rng.uniform(-3.0, 3.0, (50, config.layout.size)).astype(np.float32)
    (actions,) = session.run(["action"], {"observation": observations})
    expected = np.array([policy(each) for each in observations])
    np.testing.assert_allclose(actions, expected, atol=2e-6)
    assert np.abs(expected).max() == np.float32(0.7)  # some are clipped


@pytest.mark.parametrize("name", ["velocity", "torque", "disturbed-velocity"])
def test_the_manifest_names_what_a_robot_has_to_give_and_gets(tmp_path, name):
    policy = load_policy(name)
    write_onnx(policy, tmp_path / "p.onnx")
    told = json.loads((tmp_path / "p.json").read_text())
    env = make_env(policy.card.config)
    observation, _ = env.reset(seed=0)
    named = dict(zip(env.layout.scales, observation, strict=True))
    given = [named[entry["name"]] for entry in told["observation"]]
    np.testing.assert_array_equal(given, observation)
    assert [entry["divided_by"] for entry in told["observation"]] == list(
        env.layout.scales.values()
    )
    forward = np.zeros(len(told["action"]), np.float32)
    forward[[entry["name"] for entry in told["action"]].index("forward")] = 1.0
    moved = next(entry for entry in told["action"] if entry["name"] == "forward")
    assert (env.config.residual.matrix @ forward)[0] == moved["moves_by"]
    assert moved["unit"] == "m"
    assert tuple(told["joints"]) == env.robot.joint_names
    assert told["rate_hz"] == env.config.agent_frequency


def test_a_replay_is_no_network(tmp_path):
    with pytest.raises(ConfigError, match="a network"):
        write_onnx(load_policy("velocity-open-loop"), tmp_path / "p.onnx")
