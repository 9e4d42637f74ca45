"""Holds the scripts beside it against what darn itself says, and against their own laws:

    TRITON_INTERPRET=1 python3 check.py DARN HELD WEIGHTS

DARN is the program, HELD a folder of sheets that the weights' card was measured on. Exit status 1 where a figure is beyond its limit."""

import os
import re
import subprocess
import sys
import tempfile

import numpy
import torch

import pack
from grow import grown
from loss import CELLS, RECORD, SIDE, Samples, loss, repel_slowly, scores
from network import predict, read, write
from optimiser import Optimiser, orthogonal
from repulsion import repel
from symmetry import Turns, mean_answer
from train import WARM_UP, rate_share

WEIGHTS = {"gradient": 2.0, "stretch": 5.0, "self_penetration": 0.0, "reach": 1.0}
failed = []


def check(what, value, limit):
    """Prints a figure that should not exceed its limit."""
    good = value <= limit
    print(f"{'ok  ' if good else 'FAIL'} {what}: {value:.2e}, at most {limit:.0e}", flush=True)
    if not good:
        failed.append(what)


def largest(x):
    return x.abs().max().item()


def main():
    darn, held, path = sys.argv[1:]
    torch.manual_seed(1)
    samples = held_out(darn, held)
    card, tensors = read(path)
    with torch.no_grad():
        scores_are_the_cards(card, tensors, samples)
        few = part(samples, slice(20, 28))
        turned_samples_are_samples(tensors, few)
        grown_networks_answer_alike(darn, held, path, few)
    files(path, card, tensors)
    repulsion(tensors, part(samples, slice(27, 28)))
    slopes(tensors, part(samples, slice(27, 28)))
    optimisers()
    packing(darn, held)
    check("rate at the end of warm-up and of the time", max(1 - rate_share(WARM_UP, 0), abs(rate_share(10**6, 1) - 0.01)), 1e-9)
    sys.exit(1 if failed else 0)


def held_out(darn, held):
    command = [darn, "samples", "--sheets", held, "--held-out"]
    records = numpy.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, numpy.uint8)
    return Samples(torch.from_numpy(records.copy()).reshape(-1, RECORD))


def part(samples, which):
    one = Samples.__new__(Samples)
    for name, values in vars(samples).items():
        setattr(one, name, values[which])
    return one


def scores_are_the_cards(card, tensors, samples):
    found = scores(predict(tensors, samples.filled, samples.known), samples)
    for name, value in found.items():
        check(f"{name} {value:.4f}, off the card's", abs(value - card["scores"].get(name, float("nan"))), 5e-3)


def turned_samples_are_samples(tensors, samples):
    """Symmetries undo themselves, loss and scores do not see them, and the mean of eight is symmetric and better."""
    answer = lambda seen: predict(tensors, seen.filled, seen.known)
    guess = answer(samples)
    own = loss(guess, samples, WEIGHTS)[0]
    for number in range(16):
        flags = torch.tensor([[bool(number >> bit & 1) for bit in range(4)]]).expand(len(guess), 4)
        turns = Turns(flags)
        check(f"symmetry {number} and back", largest(turns.answers_back(turns.axes(turns.cells(guess))) - guess), 1e-7)
        turned = turns.samples(samples)
        moved = turns.axes(turns.cells(guess))
        check(f"symmetry {number}: loss", abs((loss(moved, turned, WEIGHTS)[0] - own).item()), 1e-4)
        signs = torch.linalg.det(turns.axes(torch.eye(3).expand(len(guess), 3, 3)))
        check(f"symmetry {number}: a rotation unless it is a mirror image", largest(signs - (1 - 2.0 * (number >> 3))), 1e-6)
        if number < 8:
            mean = mean_answer(answer, samples, 8)
            check(f"symmetry {number}: mean of eight", largest(turns.answers_back(mean_answer(answer, turned, 8)) - mean) * SIDE, 1e-3)
    once, eight = (scores(x, samples)["rmse_cells"] for x in (guess, mean_answer(answer, samples, 8)))
    check(f"mean of eight {eight:.4f} over once {once:.4f}", eight / once, 1.0)


def grown_networks_answer_alike(darn, held, path, samples):
    card, tensors = read(path)
    guess = predict(tensors, samples.filled, samples.known)
    for width in (24, 31):
        wide = grown(tensors, width, noise=0.0)
        check(f"width {width}: answers, cells", largest(predict(wide, samples.filled, samples.known) - guess) * SIDE, 1e-3)
        noisy = predict(grown(tensors, width), samples.filled, samples.known)
        print(f"     width {width}: noise moves answers by {largest(noisy - guess) * SIDE:.3f} cells at most")
        with tempfile.TemporaryDirectory() as folder:
            name = f"{folder}/wide.safetensors"
            write(name, card | {"architecture": card["architecture"] | {"width": width}}, wide)
            check(f"width {width}: MiB", os.path.getsize(name) / 2**20, 16)
            tables = [evaluated(darn, held, weights) for weights in (path, name)]
            check(f"width {width}: darn's RMSE {tables[1]}, off {tables[0]}", abs(tables[0] - tables[1]), 2e-3)


def evaluated(darn, held, weights):
    """The network's RMSE as filled on a few samples, by darn."""
    command = [darn, "evaluate", "--sheets", held, "--samples", "4", "--once", "--weights", weights]
    table = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return float(re.search(r"^\| network \| as filled \| ([0-9.]+)", table, re.MULTILINE).group(1))


def files(path, card, tensors):
    with tempfile.TemporaryDirectory() as folder:
        write(f"{folder}/again.safetensors", card, tensors)
        same = open(f"{folder}/again.safetensors", "rb").read() == open(path, "rb").read()
    check("a file read and written again differs", float(not same), 0)


def repulsion(tensors, one):
    with torch.no_grad():
        predicted = predict(tensors, one.filled, one.known)
    places = (predicted * SIDE).reshape(1, 3, CELLS).contiguous()
    flags = (torch.maximum(one.known, one.hole) + 2 * one.hole).reshape(1, CELLS).to(torch.int32)
    found = [[torch.empty(1, CELLS), torch.empty(1, 3, CELLS)] for _ in range(2)]
    repel_slowly(places, flags, *found[0], 1.5)
    repel(places, flags, *found[1], 1.5)
    for name, slow, fast in zip(("sums", "slopes"), *found):
        check(f"repulsion, {name} of {largest(slow):.1f}", largest(slow - fast), 1e-3)


def slopes(tensors, one):
    weights = {"gradient": 2.0, "stretch": 5.0, "self_penetration": 10.0, "reach": 1.5}
    with torch.no_grad():
        guess = predict(tensors, one.filled, one.known).double()
    for name, values in vars(one).items():
        setattr(one, name, values.double())
    guess.requires_grad_()
    loss(guess, one, weights)[0].backward()
    way, step = torch.randn_like(guess), 1e-4
    with torch.no_grad():
        ends = [loss(guess + sign * step * way, one, weights)[0] for sign in (1, -1)]
    slope, by_differences = (guess.grad * way).sum(), (ends[0] - ends[1]) / (2 * step)
    check(f"slope {slope:.3f} against differences, share", abs(1 - by_differences / slope).item(), 2e-2)


def optimisers():
    """Muon's matrices are near orthogonal; both optimisers bring a loss of kernels and vectors down and keep to their step's size."""
    for size in ((2, 24, 90), (1, 90, 24)):
        x = torch.randn(size)
        values = torch.linalg.svdvals(orthogonal(x))
        check(f"singular values of {size}, off 1", largest(values - 1), 0.35)
        u, _, v = torch.linalg.svd(x, full_matrices=False)
        inner = u.transpose(1, 2) @ orthogonal(x) @ v.transpose(1, 2)
        check(f"singular vectors of {size}", largest(inner - torch.diag_embed(inner.diagonal(dim1=1, dim2=2))), 1e-3)
    shapes = {"down.0.conv0.weight": (4, 2, 3, 3), "down.1.conv0.weight": (8, 4, 3, 3), "down.1.norm0.scale": (8,), "last.bias": (3,)}
    shapes = {name: torch.Size(shape) for name, shape in shapes.items()}
    for kind in ("adamw", "muon"):
        goal = torch.randn(sum(shape.numel() for shape in shapes.values()))
        optimiser = Optimiser(kind, torch.zeros_like(goal), shapes)
        rate = {"adamw": 1e-2, "muon": 4e-2}[kind]
        optimiser.rate.fill_(rate)
        before = optimiser.values.clone()
        for step in range(200):
            optimiser.slopes.copy_(optimiser.values - goal)
            optimiser.step()
            if step == 0:
                moved = optimiser.views(optimiser.values - before)["down.1.conv0.weight"].square().mean().sqrt().item()
        left = ((optimiser.values - goal).norm() / goal.norm()).item()
        check(f"{kind}: distance left after 200 steps, share", left, 0.5)
        # AdamW's first step is the rate for every entry; Muon's is a fifth of it in the mean.
        check(f"{kind}: size of the first step, share off", abs(moved / (rate * (0.2 if kind == "muon" else 1.0)) - 1), 0.2)


def packing(darn, held):
    """Sheets come back within half a step, parts of a source cannot overlap, and darn reads what was unpacked."""
    with tempfile.TemporaryDirectory() as folder:
        run = lambda *words: subprocess.run([sys.executable, pack.__file__, *words], capture_output=True, text=True)
        sets = ["--set", f"first={held}[:20]", "--set", f"rest={held}[20:]"]
        done = run(f"{folder}/packed", "--limit", "64", "--program", darn, *sets)
        check(f"packing ends with {done.returncode}: {done.stderr.strip()[-200:]}", done.returncode, 0)
        run("--unpack", f"{folder}/packed", f"{folder}/out")
        sheets = pack.read_sheets(held)
        back = numpy.concatenate([pack.read_sheets(f"{folder}/out/{name}") for name in ("first", "rest")])
        check("a packed sheet, in steps", float(numpy.abs(back - sheets).max() * pack.STEPS), 0.51)
        program = open(darn, "rb").read() != open(f"{folder}/out/samples", "rb").read()
        check("the program differs", float(program), 0)
        command = [darn, "samples", "--sheets", f"{folder}/out/rest", "--count", "2"]
        records = subprocess.run(command, check=True, capture_output=True).stdout
        check("bytes of two samples of unpacked sheets, off", abs(len(records) - 2 * RECORD), 0)
        overlapping = run(f"{folder}/no", "--set", f"first={held}[:20]", "--set", f"rest={held}[19:]")
        check("sets that share a sheet are packed", float("another set" not in overlapping.stderr), 0)
        large = run(f"{folder}/no", "--set", f"all={held}", "--limit", "0.1")
        check("more than the limit is packed", float("the limit is" not in large.stderr), 0)


if __name__ == "__main__":
    main()
