"""Holds network.py, loss.py and repulsion.py against what darn itself says: `TRITON_INTERPRET=1 python3 check.py DARN HELD WEIGHTS`."""

import subprocess
import sys

import numpy
import torch

from loss import CELLS, RECORD, SIDE, Samples, loss, repel_slowly, scores
from network import predict, read, write
from repulsion import repel


def main():
    darn, held, path = sys.argv[1:]
    command = [darn, "samples", "--sheets", held, "--held-out"]
    records = numpy.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, numpy.uint8)
    samples = Samples(torch.from_numpy(records.copy()).reshape(-1, RECORD))
    card, tensors = read(path)
    with torch.no_grad():
        predicted = predict(tensors, samples.filled, samples.known)
    for name, value in scores(predicted, samples).items():
        print(f"{name}: {value:.4f}, on the card {card['scores'].get(name, float('nan')):.4f}")
    write("/tmp/again.safetensors", card, tensors)
    print("read and written again:", open("/tmp/again.safetensors", "rb").read() == open(path, "rb").read())

    one = Samples.__new__(Samples)
    for name, values in vars(samples).items():
        setattr(one, name, values[27:28])
    places = (predicted[27:28] * SIDE).reshape(1, 3, CELLS).contiguous()
    flags = (torch.maximum(one.known, one.hole) + 2 * one.hole).reshape(1, CELLS).to(torch.int32)
    found = [[torch.empty(1, CELLS), torch.empty(1, 3, CELLS)] for _ in range(2)]
    repel_slowly(places, flags, *found[0], 1.5)
    repel(places, flags, *found[1], 1.5)
    for name, slow, fast in zip(("sums", "slopes"), *found):
        print(f"repulsion, {name}: {(slow - fast).abs().max():.1e} of {slow.abs().max():.1f}")

    weights = {"gradient": 2.0, "stretch": 5.0, "self_penetration": 10.0, "reach": 1.5}
    guess = predicted[27:28].clone().requires_grad_()
    loss(guess, one, weights)[0].backward()
    way, step = torch.randn_like(guess), 1e-3
    with torch.no_grad():
        ends = [loss(guess + sign * step * way, one, weights)[0] for sign in (1, -1)]
    print(f"slope: {(guess.grad * way).sum():.3f}, by differences {(ends[0] - ends[1]) / (2 * step):.3f}")


if __name__ == "__main__":
    main()
