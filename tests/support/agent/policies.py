"""Policies: networks with weights from a formula, as bytes of ONNX and as a function of numpy."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from onnx import ModelProto, NodeProto, TensorProto, helper, numpy_helper

from swarmwire.agent.onnx_policy import save_policy
from swarmwire.agent.policy_io import PolicyIO, PolicyLayout
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.bodies.body import load_body

FLOCKING = PolicyIO(
    sensors=("proximity", "compass"),
    measures=("radio.range", "radio.bearing"),
    neighbours=3,
    order="nearest",
    message=2,
    shared=("compass",),
)


def weights(sizes: tuple[int, ...]) -> list[tuple[FloatArray, FloatArray]]:
    """Matrix and bias of each layer, float32 (numbers in, numbers out) and (numbers out,)."""
    layers: list[tuple[FloatArray, FloatArray]] = []
    for layer, (rows, columns) in enumerate(pairwise(sizes)):
        matrix = np.sin(np.arange(rows * columns) * (layer + 1.7)).reshape(rows, columns) / np.sqrt(rows)
        layers.append((matrix.astype(np.float32), np.cos(np.arange(columns)).astype(np.float32) * np.float32(0.1)))
    return layers


def result(observation: FloatArray, sizes: tuple[int, ...]) -> FloatArray:
    """Expected output of the network, (n, numbers), in float64."""
    value = observation.astype(np.float64)
    for matrix, bias in weights(sizes):
        value = np.tanh(value @ matrix + bias)
    return value


def network(sizes: tuple[int, ...], rows: str | int = "rows", last: NodeProto | None = None) -> bytes:
    """An ONNX model of these layers, each with tanh; `last` is a node from "end" to "action" beyond them."""
    nodes, parameters, name = [], [], "observation"
    layers = weights(sizes)
    for layer, (matrix, bias) in enumerate(layers):
        parameters += [numpy_helper.from_array(matrix, f"w{layer}"), numpy_helper.from_array(bias, f"b{layer}")]
        after = ("end" if last else "action") if layer == len(layers) - 1 else f"value{layer}"
        nodes += [
            helper.make_node("Gemm", [name, f"w{layer}", f"b{layer}"], [f"sum{layer}"]),
            helper.make_node("Tanh", [f"sum{layer}"], [after]),
        ]
        name = after
    ends = [
        helper.make_tensor_value_info(end, TensorProto.FLOAT, [rows, size])
        for end, size in (("observation", sizes[0]), ("action", sizes[-1]))
    ]
    graph = helper.make_graph([*nodes, *([last] if last else [])], "policy", ends[:1], ends[1:], parameters)
    model: ModelProto = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return model.SerializeToString()


def saved(path: Path, body: str = "epuck", io: PolicyIO = FLOCKING) -> Path:
    """A policy's file for a body."""
    layout = PolicyLayout(io, load_body(body))
    save_policy(path, network((len(layout.observation), 32, len(layout.action))), layout)
    return path
