"""The loss of src/train/loss.rs and the scores of src/train/score.rs in PyTorch, on records of `darn samples`. Lengths in cells."""

import torch

SIDE, CELLS = 64, 4096
RECORD = 2 * 3 * CELLS * 4 + 3 * 4 + CELLS
DATA_BEND, GRADIENT_BEND, LENGTH_GUARD, KNOWN_WEIGHT = 1.0, 0.25, 1e-4, 0.1
# Cells no farther apart than this on the grid are one piece of cloth.
NEIGHBOURS = 3


class Samples:
    """Records `[n, RECORD]` of bytes as tensors."""

    def __init__(self, records):
        n, numbers = len(records), records.view(torch.float32)
        planes = lambda k: numbers[:, 3 * CELLS * k : 3 * CELLS * (k + 1)].reshape(n, 3, SIDE, SIDE)
        self.filled, self.truth = planes(0), planes(1)
        self.up = numbers[:, 6 * CELLS : 6 * CELLS + 3]
        flags = records[:, RECORD - CELLS :].reshape(n, 1, SIDE, SIDE)
        self.known, self.hole, self.valid = ((flags & bit > 0).float() for bit in (1, 2, 4))


def both(x, dim, join):
    """Joins every cell but the last along a dimension: the next one, and itself."""
    n = x.shape[dim]
    return join(x.narrow(dim, 1, n - 1), x.narrow(dim, 0, n - 1))


def difference(x, dim):
    return both(x, dim, torch.sub)


def mean(x, weight):
    return (x * weight).sum() / weight.sum().clamp(min=1e-6)


def softened(x, bend):
    return torch.sqrt((x * x).sum(1, keepdim=True) + bend * bend) - bend


def length(x):
    return torch.sqrt((x * x).sum(1, keepdim=True) + LENGTH_GUARD)


def pairs(samples, dim):
    """1 for pairs along a dimension that both have a truth and touch the hole."""
    return both(samples.valid, dim, torch.mul) * both(samples.hole, dim, torch.maximum)


def loss(predicted, samples, weights):
    """The total and its terms: data, gradient, stretch, self-penetration. `weights`: gradient, stretch, self_penetration, reach."""
    truth = samples.truth * SIDE
    error = predicted * SIDE - truth
    data = mean(softened(error, DATA_BEND), samples.hole + KNOWN_WEIGHT * samples.known * (1 - samples.hole))
    # Known cells keep the scan's positions, so only hole cells carry an error into the pairs.
    error = error * samples.hole
    composed = truth + error
    gradient = stretch = 0.0
    for dim in (3, 2):
        weight = pairs(samples, dim)
        gradient = gradient + 0.5 * mean(softened(difference(error, dim), GRADIENT_BEND), weight)
        longer = length(difference(composed, dim)) - length(difference(truth, dim))
        stretch = stretch + 0.5 * mean(longer * longer, weight)
    total = data + weights["gradient"] * gradient + weights["stretch"] * stretch
    penetration = torch.zeros_like(data)
    if weights["self_penetration"] > 0:
        present = torch.maximum(samples.known, samples.hole)
        repelled = Repulsion.apply(composed, present, samples.hole, weights["reach"])
        penetration = repelled / samples.hole.sum().clamp(min=1)
        total = total + weights["self_penetration"] * penetration
    return total, torch.stack([total, data, gradient, stretch, penetration]).detach()


class Repulsion(torch.autograd.Function):
    """Σ (reach − d)² over pairs of present cells that are d < reach apart but no neighbours on the grid, one of them open at least."""

    @staticmethod
    def forward(ctx, composed, present, open_, reach):
        n = len(composed)
        places = composed.detach().reshape(n, 3, CELLS).contiguous()
        flags = (present + 2 * open_).reshape(n, CELLS).to(torch.int32).contiguous()
        sums, slopes = torch.empty(n, CELLS, device=places.device), torch.empty_like(places)
        if places.is_cuda:
            from repulsion import repel

            repel(places, flags, sums, slopes, reach)
        else:
            repel_slowly(places, flags, sums, slopes, reach)
        ctx.save_for_backward(slopes.reshape(composed.shape))
        return sums.sum()

    @staticmethod
    def backward(ctx, gradient):
        (slopes,) = ctx.saved_tensors
        return gradient * slopes, None, None, None


def repel_slowly(places, flags, sums, slopes, reach):
    """What repulsion.repel does, on any device. A pair is met from both ends: half of it counts at each, its slope at both."""
    cell = torch.arange(CELLS, device=places.device)
    column, row = cell % SIDE, cell // SIDE
    apart = lambda x: (x[:, None] - x[None, :]).abs() > NEIGHBOURS
    far = apart(column) | apart(row)
    for x, flag, total, slope in zip(places, flags, sums, slopes):
        present, open_ = flag & 1 > 0, flag & 2 > 0
        counted = far & (present[:, None] & present[None, :]) & (open_[:, None] | open_[None, :])
        step = x[:, :, None] - x[:, None, :]
        distance = torch.sqrt((step * step).sum(0) + LENGTH_GUARD)
        depth = (reach - distance).clamp(min=0) * counted
        total.copy_(0.5 * (depth * depth).sum(1))
        slope.copy_((-2 * depth / distance * step).sum(2))


def scores(predicted, samples):
    """Means over samples, as `darn train` has them: rmse, its median, normals in degrees, spacing and area over the truth's."""
    answer = torch.where(samples.hole > 0, predicted, samples.truth).double()
    truth, hole = samples.truth.double(), samples.hole.double()
    holes = hole.sum((1, 2, 3))
    rmse = torch.sqrt((((answer - truth) * SIDE) ** 2).sum((1, 2, 3)) / holes)
    inner = slice(1, -1)
    valid = samples.valid
    whole = valid[..., inner, 2:] * valid[..., inner, :-2] * valid[..., 2:, inner] * valid[..., :-2, inner]
    counted = whole[:, 0] * samples.hole[:, 0, inner, inner]

    def normals(x):
        return torch.cross(x[..., inner, 2:] - x[..., inner, :-2], x[..., 2:, inner] - x[..., :-2, inner], dim=1)

    mine, true = normals(answer), normals(truth)
    size = [x.norm(dim=1) for x in (mine, true)]
    cosine = (mine * true).sum(1) / (size[0] * size[1]).clamp(min=1e-30)
    angle = torch.rad2deg(torch.acos(cosine.clamp(-1, 1)))
    total = lambda x: (x * counted).sum((1, 2))
    spacing = [
        sum((difference(x, dim).norm(dim=1, keepdim=True) * pairs(samples, dim)).sum((1, 2, 3)) for dim in (3, 2))
        for x in (answer, truth)
    ]
    return {
        "rmse_cells": rmse.mean().item(),
        "rmse_median_cells": rmse.sort().values[len(rmse) // 2].item(),
        "normal_degrees": (total(angle) / counted.sum((1, 2)).clamp(min=1)).mean().item(),
        "spacing_ratio": (spacing[0] / spacing[1]).mean().item(),
        "area_ratio": (total(size[0]) / total(size[1])).mean().item(),
    }
