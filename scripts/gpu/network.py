"""The network of a weights file in PyTorch, as src/net/unet.rs has it, batch norm with the statistics it has: for training and for measuring."""

import json
import os
import struct

import torch
from torch.nn.functional import conv2d, interpolate, max_pool2d, relu

EPSILON = 1e-5
INPUT_SCALE, OUTPUT_SCALE = 4.0, 1.0 / 16.0
DTYPES = {"F16": torch.float16, "F32": torch.float32}


def read(path):
    """The card and the tensors by name, f32."""
    data = bytearray(open(path, "rb").read())
    (size,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    card = json.loads(header.pop("__metadata__")["darn"])
    tensors = {}
    for name, entry in header.items():
        start, end = (8 + size + at for at in entry["data_offsets"])
        values = torch.frombuffer(data[start:end], dtype=DTYPES[entry["dtype"]])
        tensors[name] = values.reshape(entry["shape"]).float()
    return card, tensors


def write(path, card, tensors):
    """Kernels as f16, vectors as f32; the order of src/net/weights.rs. A reader sees the old file or the new one, never a part."""
    header, body, at = {"__metadata__": {"darn": json.dumps(card, separators=(",", ":"))}}, [], 0
    for kind in ("F32", "F16"):
        for name in sorted(tensors):
            values = tensors[name]
            if (values.dim() > 1) != (kind == "F16"):
                continue
            data = values.to(DTYPES[kind]).contiguous().numpy().tobytes()
            header[name] = {"dtype": kind, "shape": list(values.shape), "data_offsets": [at, at + len(data)]}
            body.append(data)
            at += len(data)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(f"{path}.partial", "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + b"".join(body))
    os.replace(f"{path}.partial", path)


def told_up(tensors):
    """The tensors with three channels more to see, which mean nothing yet."""
    kernel = tensors["down.0.conv0.weight"]
    more = torch.zeros(kernel.shape[0], 7 - kernel.shape[1], 3, 3)
    return tensors | {"down.0.conv0.weight": torch.cat([kernel, more], 1)}


def predict(tensors, filled, known, up=None):
    """Positions of all cells: `[n, 3, 64, 64]`, `[n, 1, 64, 64]` and perhaps `[n, 3]` to `[n, 3, 64, 64]`, in the network's units."""

    def conv(x, name, norm=None):
        weight = tensors[f"{name}.weight"]
        if norm is None:
            return conv2d(x, weight, tensors[f"{name}.bias"], padding=weight.shape[-1] // 2)
        scale, shift, mean, variance = (tensors[f"{norm}.{part}"] for part in ("scale", "shift", "mean", "variance"))
        factor = scale / torch.sqrt(variance + EPSILON)
        return conv2d(x, weight * factor[:, None, None, None], shift - mean * factor, padding=weight.shape[-1] // 2)

    def block(x, name):
        for i in range(2):
            x = relu(conv(x, f"{name}.conv{i}", f"{name}.norm{i}"))
        return x

    seen = [filled * INPUT_SCALE, known]
    if up is not None:
        seen.append(up[:, :, None, None].expand(-1, -1, *filled.shape[2:]))
    x = torch.cat(seen, 1).contiguous(memory_format=torch.channels_last)
    skips = []
    for level in range(5):
        x = block(max_pool2d(x, 2) if level else x, f"down.{level}")
        skips.append(x)
    for level in (3, 2, 1, 0):
        name, skip = f"up.{level}", skips[level]
        x = relu(conv(interpolate(x, scale_factor=2, mode="nearest"), f"{name}.conv", f"{name}.norm"))
        joint = conv(skip, f"{name}.gate.skip", f"{name}.gate.skip_norm") + conv(
            x, f"{name}.gate.signal", f"{name}.gate.signal_norm"
        )
        skip = skip * torch.sigmoid(conv(relu(joint), f"{name}.gate.score"))
        x = block(torch.cat([skip, x], 1), f"{name}.block")
    return conv(x, "last") * OUTPUT_SCALE + filled
