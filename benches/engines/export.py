"""The network of a weights file as an ONNX model: batch norm folded, input [n, 4, 64, 64], output [n, 3, 64, 64]."""

import json
import struct

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper

EPSILON = 1e-5
DTYPES = {"F16": np.float16, "F32": np.float32}


def read(path):
    """Tensors by name, f64."""
    data = open(path, "rb").read()
    (size,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    tensors = {}
    for name, entry in header.items():
        if name != "__metadata__":
            start, end = (8 + size + at for at in entry["data_offsets"])
            values = np.frombuffer(data[start:end], DTYPES[entry["dtype"]])
            tensors[name] = values.reshape(entry["shape"]).astype(np.float64)
    return tensors


def folded(tensors, name, norm=None):
    """Weight and bias of a convolution, the norm after it folded in."""
    weight = tensors[f"{name}.weight"]
    if norm is None:
        return weight, tensors[f"{name}.bias"]
    scale, shift, mean, variance = (tensors[f"{norm}.{part}"] for part in ("scale", "shift", "mean", "variance"))
    factor = scale / np.sqrt(variance + EPSILON)
    return weight * factor[:, None, None, None], shift - mean * factor


class Graph:
    """Nodes and constants of a model under construction."""

    def __init__(self, tensors):
        self.tensors = tensors
        self.nodes, self.constants = [], []

    def constant(self, values, dtype=np.float32):
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(values, dtype), name))
        return name

    def node(self, kind, inputs, **attributes):
        name = f"n{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def conv(self, x, name, norm=None):
        """A convolution that keeps the size, with the norm after it folded in."""
        weight, bias = folded(self.tensors, name, norm)
        side = weight.shape[-1]
        inputs = [x, self.constant(weight), self.constant(bias)]
        return self.node("Conv", inputs, kernel_shape=[side] * 2, pads=[side // 2] * 4)

    def relu(self, x):
        return self.node("Relu", [x])

    def block(self, x, name):
        for i in range(2):
            x = self.relu(self.conv(x, f"{name}.conv{i}", f"{name}.norm{i}"))
        return x

    def up(self, x, skip, name):
        scales = self.constant([1, 1, 2, 2])
        attributes = dict(mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor")
        x = self.node("Resize", [x, "", scales], **attributes)
        x = self.relu(self.conv(x, f"{name}.conv", f"{name}.norm"))
        parts = [
            self.conv(y, f"{name}.gate.{part}", f"{name}.gate.{part}_norm")
            for part, y in (("skip", skip), ("signal", x))
        ]
        score = self.conv(self.relu(self.node("Add", parts)), f"{name}.gate.score")
        skip = self.node("Mul", [skip, self.node("Sigmoid", [score])])
        return self.block(self.node("Concat", [skip, x], axis=1), f"{name}.block")


def export(path, batch):
    """The model's bytes."""
    graph = Graph(read(path))
    x, skips = "x", []
    for level in range(5):
        if level > 0:
            x = graph.node("MaxPool", [x], kernel_shape=[2, 2], strides=[2, 2])
        x = graph.block(x, f"down.{level}")
        skips.append(x)
    for level in reversed(range(4)):
        x = graph.up(x, skips[level], f"up.{level}")
    x = graph.conv(x, "last")

    def value(name, channels):
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, [batch, channels, 64, 64])

    model = helper.make_model(
        helper.make_graph(graph.nodes, "unet", [value("x", 4)], [value(x, 3)], graph.constants),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=9,
    )
    checker.check_model(model)
    return model.SerializeToString()
