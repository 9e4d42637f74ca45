"""The symmetries of samples and answers in the canonical frame: the eight of the grid's square, and its mirror image in space.

The frame follows the chart, so a symmetry of the grid moves cells and turns positions with them; a mirror image of the cloth is one in the
chart's plane. All are exact: they cost no interpolation and no new plate.
"""

import copy
from functools import lru_cache

import torch


class Turns:
    """A symmetry for each of n samples: `flags [n, 4]` of bool: flip u, flip v, swap u and v, mirror."""

    def __init__(self, flags):
        self.flip_u, self.flip_v, self.swap, self.mirror = flags.unbind(1)
        one = lambda flag: torch.where(flag, -1.0, 1.0)
        u, v = one(self.flip_u), one(self.flip_v)
        depth = u * v * one(self.swap) * one(self.mirror)
        self.signs = torch.stack([u, v, depth], 1)

    @staticmethod
    @lru_cache(maxsize=None)
    def of_square(number, count, device):
        """The symmetry that `origins` of crates/net/src/symmetry.rs numbers so, for all of `count` samples; kept, since a CUDA graph cannot make
        its tensors."""
        flags = [bool(number >> bit & 1) for bit in range(3)] + [False]
        return Turns(torch.tensor([flags], device=device).expand(count, 4))

    def cells(self, planes):
        """Moves the cells of `[n, c, 64, 64]`."""
        chosen = lambda flag: flag[:, None, None, None]
        planes = torch.where(chosen(self.swap), planes.transpose(2, 3), planes)
        # The swapped grid is flipped, so that a cell comes from the swap of its flipped place.
        planes = torch.where(chosen(self.flip_u), planes.flip(3), planes)
        return torch.where(chosen(self.flip_v), planes.flip(2), planes)

    def cells_back(self, planes):
        chosen = lambda flag: flag[:, None, None, None]
        planes = torch.where(chosen(self.flip_u), planes.flip(3), planes)
        planes = torch.where(chosen(self.flip_v), planes.flip(2), planes)
        return torch.where(chosen(self.swap), planes.transpose(2, 3), planes)

    def axes(self, x):
        """Turns the three components, dimension 1 of `[n, 3, ...]`."""
        fit = lambda flags: flags.reshape(flags.shape + (1,) * (x.dim() - flags.dim()))
        swapped = torch.cat([x[:, 1:2], x[:, :1], x[:, 2:]], 1)
        return torch.where(fit(self.swap), swapped, x) * fit(self.signs)

    def axes_back(self, x):
        fit = lambda flags: flags.reshape(flags.shape + (1,) * (x.dim() - flags.dim()))
        x = x * fit(self.signs)
        return torch.where(fit(self.swap), torch.cat([x[:, 1:2], x[:, :1], x[:, 2:]], 1), x)

    def samples(self, samples):
        """The samples after their symmetries."""
        turned = copy.copy(samples)
        for name in ("filled", "truth"):
            setattr(turned, name, self.axes(self.cells(getattr(samples, name))))
        for name in ("known", "hole", "valid"):
            setattr(turned, name, self.cells(getattr(samples, name)))
        turned.up = self.axes(samples.up)
        return turned

    def answers_back(self, answers):
        """Answers to turned samples, `[n, 3, 64, 64]`, as answers to the samples."""
        return self.cells_back(self.axes_back(answers))


def mean_answer(answer, samples, symmetries):
    """The mean of a network's answers to the first so many symmetries of the square: 4 are the flips that `darn` asks, 8 are all."""
    total = 0.0
    for number in range(symmetries):
        turns = Turns.of_square(number, len(samples.filled), samples.filled.device)
        total = total + turns.answers_back(answer(turns.samples(samples)))
    return total / symmetries
