"""What bf16 would cost: how far answers are off, in cells, when the operands of all products are rounded to it (sums in f32).

usage: bf16.py WEIGHTS SHEETS/sheets.safetensors      200 held-out sheets with round holes, filled smoothly"""

import sys

import numpy as np
import torch
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

import pytorch
from export import read

SIDE, GRIDS = 64, 200
INPUT_SCALE, OUTPUT_SCALE = 4.0, 1.0 / 16.0  # src/net/unet.rs


def grid(sheet):
    """Cells of unit spacing ÷ 64 about the origin, `[64, 64, 3]`."""
    given, wanted = np.linspace(0, 1, len(sheet)), (np.arange(SIDE) + 0.5) / SIDE
    cells = np.stack([RectBivariateSpline(given, given, sheet[..., d])(wanted, wanted) for d in range(3)], -1)
    spacing = np.mean([np.linalg.norm(np.diff(cells, axis=a), axis=-1).mean() for a in (0, 1)])
    return (cells - cells.mean((0, 1))) / (spacing * SIDE)


def filled(cells, hole):
    """The hole's cells where the squared Laplacian is least."""
    index, entries, rhs = np.cumsum(hole.ravel()).reshape(hole.shape) - 1, [], []
    for i, j in np.argwhere(np.ones((SIDE - 2, SIDE - 2))) + 1:
        stencil = [(i, j, -4.0), (i + 1, j, 1.0), (i - 1, j, 1.0), (i, j + 1, 1.0), (i, j - 1, 1.0)]
        if any(hole[a, b] for a, b, _ in stencil):
            entries += [(len(rhs), index[a, b], w) for a, b, w in stencil if hole[a, b]]
            rhs.append(-sum(w * cells[a, b] for a, b, w in stencil if not hole[a, b]) + np.zeros(3))
    rows, columns, weights = map(np.array, zip(*entries))
    matrix = csr_matrix((weights, (rows, columns)), (len(rhs), hole.sum()))
    cells = cells.copy()
    cells[hole] = splu((matrix.T @ matrix).tocsc()).solve(matrix.T @ np.array(rhs))
    return cells


def main(weights, path):
    rng, sheets, inputs, holes = np.random.default_rng(0), read(path)["positions"], [], []
    places = np.stack(np.meshgrid(range(SIDE), range(SIDE), indexing="ij"), -1)
    for k in range(GRIDS):
        centre, radius = rng.uniform(24, 40, 2), rng.uniform(8, 18)
        hole = ((places - centre) ** 2).sum(-1) < radius**2
        cells = filled(grid(sheets[k % len(sheets)]), hole)
        inputs.append(np.concatenate([INPUT_SCALE * cells.transpose(2, 0, 1), ~hole[None]]))
        holes.append(hole)
    x, holes = np.array(inputs, np.float32), np.array(holes)
    answer = {}
    for product in (pytorch.exact, pytorch.bf16, pytorch.bf16_winograd):
        run = pytorch.forward(pytorch.Network(weights, product), torch.get_num_threads())
        answer[product.__name__] = OUTPUT_SCALE * SIDE * run(x)
    size = np.sqrt((answer["exact"] ** 2).sum(1)[holes].mean())
    print(f"answers: {size:.2f} cells RMS\n\n| products | off, cells RMS | 99 % | most |\n|---|---|---|---|")
    for name in ("bf16", "bf16_winograd"):
        off = np.sqrt(((answer[name] - answer["exact"]) ** 2).sum(1))[holes]
        print(f"| {name} | {np.sqrt((off**2).mean()):.4f} | {np.quantile(off, 0.99):.3f} | {off.max():.3f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
