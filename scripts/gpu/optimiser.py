"""AdamW and Muon as crates/lab/src/train has them, on parameters that lie in one flat tensor; every step is tensor work, so that a CUDA graph
can hold it."""

import math

import torch

BETA1, BETA2, EPSILON, DECAY, CLIP, AVERAGE = 0.9, 0.99, 1e-8, 1e-2, 1.0, 0.998
MOMENTUM, STEP_SIZE, ITERATIONS = 0.95, 0.2, 5
QUINTIC = 3.4445, -4.7750, 2.0315


def orthogonal(matrices):
    """Matrices `[n, rows, columns]` with the singular vectors of the given ones and singular values near 1 (Newton and Schulz)."""
    tall = matrices.shape[1] > matrices.shape[2]
    x = matrices.transpose(1, 2) if tall else matrices
    # Half precision is enough for a direction, and several times as fast on a GPU.
    x = x.bfloat16() if x.is_cuda else x
    x = x / x.norm(dim=(1, 2), keepdim=True).clamp(min=1e-20)
    a, b, c = QUINTIC
    for _ in range(ITERATIONS):
        gram = x @ x.transpose(1, 2)
        x = a * x + (b * gram + c * gram @ gram) @ x
    return (x.transpose(1, 2) if tall else x).to(matrices.dtype)


def muon_trains(name, shape):
    """Kernels between the first and the last layer with more than one output."""
    return len(shape) == 4 and shape[0] > 1 and not name.startswith(("down.0.conv0.", "last."))


class Optimiser:
    """Moves `values`; `shapes` says by name, in order, what lies in them."""

    def __init__(self, kind, values, shapes):
        if kind not in ("adamw", "muon"):
            raise SystemExit(f"optimiser {kind}: adamw or muon")
        self.values, self.shapes = values, shapes
        self.slopes, self.first, self.second = (torch.zeros_like(values) for _ in range(3))
        self.averaged = values.clone()
        spread = lambda of: torch.cat([torch.full([s.numel()], float(of(n, s))) for n, s in shapes.items()]).to(values.device)
        self.kernels = spread(lambda _, shape: len(shape) > 1)
        muon = lambda name, shape: kind == "muon" and muon_trains(name, shape)
        self.share = 1 - spread(lambda name, shape: MOMENTUM if muon(name, shape) else BETA1)
        # Matrices of one size go through Newton and Schulz together.
        self.groups, at = {}, 0
        for name, shape in shapes.items():
            if muon(name, shape):
                size = shape[0], shape[1:].numel()
                self.groups.setdefault(size, []).append(slice(at, at + shape.numel()))
            at += shape.numel()
        self.rate = torch.zeros((), device=values.device)
        self.time = torch.zeros((), device=values.device, dtype=torch.float64)

    def state(self):
        return [self.values, self.first, self.second, self.averaged, self.time]

    @torch.no_grad()
    def step(self):
        """One step down `slopes`; returns their norm before clipping."""
        norm = self.slopes.norm()
        # A step that is not finite is not taken.
        slopes = torch.where(norm.isfinite(), self.slopes * (CLIP / norm).clamp(max=1), 0)
        self.time += 1
        self.first.add_((slopes - self.first) * self.share)
        self.second.lerp_(slopes * slopes, 1 - BETA2)
        unbias = [(1 / (1 - beta**self.time)).float() for beta in (BETA1, BETA2)]
        change = self.first * unbias[0] / (torch.sqrt(self.second * unbias[1]) + EPSILON)
        for size, places in self.groups.items():
            mean, slope = (torch.stack([x[place] for place in places]) for x in (self.first, slopes))
            ahead = mean * MOMENTUM + slope * (1 - MOMENTUM)
            moved = orthogonal(ahead.reshape(-1, *size)) * (STEP_SIZE * math.sqrt(max(size)))
            for place, one in zip(places, moved):
                change[place] = one.flatten()
        self.values.mul_(1 - self.rate * DECAY * self.kernels).sub_(change * self.rate)
        keep = torch.clamp((1 + self.time) / (10 + self.time), max=AVERAGE).float()
        self.averaged.mul_(keep).add_(self.values * (1 - keep))
        return norm

    def views(self, flat):
        views, at = {}, 0
        for name, shape in self.shapes.items():
            views[name] = flat[at : at + shape.numel()].view(shape)
            at += shape.numel()
        return views
