"""A policy as ONNX, beside it a manifest that names its inputs and outputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.errors import ConfigError, MissingDependencyError
from icub_jump_env.files import strict_json, write_files
from icub_jump_env.planning.residual import AXES, COM_AXES
from icub_jump_env.policy import NetworkPolicy
from icub_jump_env.policy.saving import LoadedPolicy

OPSET = 17
"""Version of the ONNX operators, of 2022: what runtimes on robots have."""


def write_onnx(policy: LoadedPolicy, path: Path) -> None:
    """Write ``path``, a model from ``observation`` (k, m) to ``action`` (k, n), float32.

    Both are as the environment has them: observations divided by their scales, actions in
    [-1, 1]. ``path`` with the ending ``.json`` is the manifest.

    Args:
        policy: A policy that is a network.
        path: The file.

    Raises:
        ConfigError: If the policy is not a network.
        MissingDependencyError: Without the package ``onnx``.
        OSError: If the file system refuses.
    """
    network = policy.policy
    if not isinstance(network, NetworkPolicy):
        raise ConfigError("policy", policy.card.kind, "a network")
    try:
        import onnx
    except ImportError:
        raise MissingDependencyError.of_extra("ONNX", "export") from None
    model = onnx.helper.make_model(
        _graph(network, onnx.helper),
        producer_name="icub_jump_env",
        opset_imports=[onnx.helper.make_opsetid("", OPSET)],
        ir_version=8,
    )
    onnx.checker.check_model(model)
    told = strict_json(manifest(policy), indent=2) + "\n"
    write_files({path.with_suffix(".json"): told.encode(), path: model.SerializeToString()})


def manifest(policy: LoadedPolicy) -> dict[str, Any]:
    """What each input and output is, by name, and the environment that they are of."""
    card = policy.card
    residual = card.config.residual
    units = {axis: "m" if axis in COM_AXES else "kg m^2/s" for axis in AXES}
    return {
        "observation": [{"name": name, "divided_by": scale} for name, scale in card.observation],
        "action": [
            {"name": axis, "moves_by": residual.scale[AXES.index(axis)], "unit": units[axis]}
            for axis in residual.axes
        ],
        "joints": list(card.config.robot_value.joint_names),
        "rate_hz": card.config.agent_frequency,
        "sha256": card.sha256,
        "config": card.as_dict()["config"],
    }


def _graph(network: NetworkPolicy, helper: Any) -> Any:
    """Pick the inputs, the layers, and put the outputs on their axes."""
    from onnx import TensorProto, numpy_helper

    entries, action_axes = network.entries, network.action_axes
    constants: dict[str, NDArray[Any]] = {
        "columns": np.array([entries.index(name) for name in network.inputs], np.int64),
        "least": np.array(-1.0, np.float32),
        "largest": np.array(1.0, np.float32),
        "axes": np.zeros((len(network.axes), len(action_axes)), np.float32),
    }
    for row, axis in enumerate(network.axes):
        constants["axes"][row, action_axes.index(axis)] = network.action_scale
    nodes = [helper.make_node("Gather", ["observation", "columns"], ["x0"], axis=1)]
    for number, (weight, bias) in enumerate(network.layers):
        constants[f"weight{number}"], constants[f"bias{number}"] = weight, bias
        last = number == len(network.layers) - 1
        names = [f"x{number}", f"weight{number}", f"bias{number}"]
        output = "linear" if last else f"h{number}"
        nodes.append(helper.make_node("Gemm", names, [output], transB=1))
        if not last:
            nodes.append(helper.make_node("Tanh", [output], [f"x{number + 1}"]))
    nodes.append(helper.make_node("Clip", ["linear", "least", "largest"], ["clipped"]))
    nodes.append(helper.make_node("MatMul", ["clipped", "axes"], ["action"]))
    float32 = TensorProto.FLOAT
    return helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", float32, ["k", len(entries)])],
        [helper.make_tensor_value_info("action", float32, ["k", len(action_axes)])],
        [numpy_helper.from_array(np.asarray(array), name) for name, array in constants.items()],
    )
