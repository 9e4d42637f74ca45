"""The network of a weights file in PyTorch, batch norm folded; products in f32, or with operands rounded to bf16 and sums in f32."""

import torch
from torch.nn.functional import conv2d, interpolate, max_pool2d, pad, relu

from export import folded, read

# Winograd's F(4, 3): kernel, input and output transforms (Lavin & Gray 2016), as in src/net/engine/scheme.rs.
KERNEL = [[1 / 4, 0, 0], [-1 / 6] * 3, [-1 / 6, 1 / 6, -1 / 6], [1 / 24, 1 / 12, 1 / 6], [1 / 24, -1 / 12, 1 / 6], [0, 0, 1]]
ENTER = [[4, 0, -5, 0, 1, 0], [0, -4, -4, 1, 1, 0], [0, 4, -4, -1, 1, 0], [0, -2, -1, 2, 1, 0], [0, 2, -1, -2, 1, 0], [0, 4, 0, -5, 0, 1]]
LEAVE = [[1, 1, 1, 1, 1, 0], [0, 1, -1, 2, -2, 0], [0, 1, 1, 4, 4, 0], [0, 1, -1, 8, -8, 1]]


def rounded(x):
    return x.bfloat16().float()


def exact(x, weight, bias):
    return conv2d(x, weight, bias, padding=weight.shape[-1] // 2)


def bf16(x, weight, bias):
    return exact(rounded(x), rounded(weight), bias)


def bf16_winograd(x, weight, bias):
    """As the engine computes: tiles of 4×4 cells where the side allows them, rounded where they are multiplied."""
    if weight.shape[-1] != 3 or x.shape[-1] < 16:
        return bf16(x, weight, bias)
    kernel, enter, leave = (torch.tensor(m, dtype=torch.float32) for m in (KERNEL, ENTER, LEAVE))
    tiles = pad(x, (1, 1, 1, 1)).unfold(2, 6, 4).unfold(3, 6, 4)
    tiles = rounded(torch.einsum("ij,nchwjk,lk->nchwil", enter, tiles, enter))
    weight = rounded(torch.einsum("ij,ocjk,lk->ocil", kernel, weight, kernel))
    products = torch.einsum("ocil,nchwil->nohwil", weight, tiles)
    cells = torch.einsum("ij,nohwjk,lk->nohwil", leave, products, leave)
    count, channels, rows, columns, _, _ = cells.shape
    cells = cells.permute(0, 1, 2, 4, 3, 5).reshape(count, channels, 4 * rows, 4 * columns)
    return cells + bias[:, None, None]


class Network:
    """`[n, 4, 64, 64]` to `[n, 3, 64, 64]`, as export.py's model."""

    def __init__(self, weights, product=exact):
        tensors = read(weights)
        self.product, self.layers = product, {}
        for name in tensors:
            conv, _, part = name.rpartition(".")
            if part != "weight":
                continue
            stem, _, last = conv.rpartition(".")
            last = last.replace("conv", "norm") if "conv" in last else f"{last}_norm"
            norm = f"{stem}.{last}" if f"{stem}.{last}.scale" in tensors else None
            self.layers[conv] = [torch.tensor(x, dtype=torch.float32) for x in folded(tensors, conv, norm)]

    def conv(self, x, name):
        return self.product(x, *self.layers[name])

    def block(self, x, name):
        for i in range(2):
            x = relu(self.conv(x, f"{name}.conv{i}"))
        return x

    def __call__(self, x):
        skips = []
        for level in range(5):
            x = self.block(max_pool2d(x, 2) if level else x, f"down.{level}")
            skips.append(x)
        for level in (3, 2, 1, 0):
            name, skip = f"up.{level}", skips[level]
            x = relu(self.conv(interpolate(x, scale_factor=2, mode="nearest"), f"{name}.conv"))
            joint = relu(self.conv(skip, f"{name}.gate.skip") + self.conv(x, f"{name}.gate.signal"))
            skip = skip * torch.sigmoid(self.conv(joint, f"{name}.gate.score"))
            x = self.block(torch.cat([skip, x], 1), f"{name}.block")
        return exact(x, *self.layers["last"])


def forward(network, threads):
    """A call that answers as numpy."""

    def run(x):
        torch.set_num_threads(threads)
        with torch.inference_mode():
            return network(torch.from_numpy(x)).numpy()

    return run


def gradient(network, threads):
    """A call that answers the gradient of the sum of all outputs by the input."""

    def run(x):
        torch.set_num_threads(threads)
        x = torch.from_numpy(x).requires_grad_()
        return torch.autograd.grad(network(x).sum(), x)[0].numpy()

    return run
