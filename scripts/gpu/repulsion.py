"""Repulsion of cloth from cloth as one Triton kernel: all pairs of cells of every grid, nothing kept but sums and slopes."""

import triton
import triton.language as tl

BLOCK = 64


@triton.jit
def kernel(places, flags, sums, slopes, reach, guard, CELLS: tl.constexpr, SIDE: tl.constexpr, NEIGHBOURS: tl.constexpr, BLOCK: tl.constexpr):
    grid = tl.program_id(1)
    a = tl.program_id(0) * BLOCK + tl.arange(0, BLOCK)
    base = places + grid * 3 * CELLS
    ax, ay, az = tl.load(base + a), tl.load(base + CELLS + a), tl.load(base + 2 * CELLS + a)
    flag_a = tl.load(flags + grid * CELLS + a)
    total = tl.zeros([BLOCK], tl.float32)
    sx, sy, sz = total, total, total
    for start in range(0, CELLS, BLOCK):
        b = start + tl.arange(0, BLOCK)
        flag_b = tl.load(flags + grid * CELLS + b)
        dx = ax[:, None] - tl.load(base + b)[None, :]
        dy = ay[:, None] - tl.load(base + CELLS + b)[None, :]
        dz = az[:, None] - tl.load(base + 2 * CELLS + b)[None, :]
        distance = tl.sqrt(dx * dx + dy * dy + dz * dz + guard)
        columns = tl.abs(a[:, None] % SIDE - b[None, :] % SIDE)
        rows = tl.abs(a[:, None] // SIDE - b[None, :] // SIDE)
        far = (columns > NEIGHBOURS) | (rows > NEIGHBOURS)
        present = (flag_a[:, None] & flag_b[None, :] & 1) > 0
        open_ = ((flag_a[:, None] | flag_b[None, :]) & 2) > 0
        depth = tl.where(far & present & open_, tl.maximum(reach - distance, 0.0), 0.0)
        total += tl.sum(depth * depth, 1)
        slope = -2.0 * depth / distance
        sx += tl.sum(slope * dx, 1)
        sy += tl.sum(slope * dy, 1)
        sz += tl.sum(slope * dz, 1)
    tl.store(sums + grid * CELLS + a, 0.5 * total)
    out = slopes + grid * 3 * CELLS
    tl.store(out + a, sx)
    tl.store(out + CELLS + a, sy)
    tl.store(out + 2 * CELLS + a, sz)


def repel(places, flags, sums, slopes, reach):
    """Fills `sums [n, 4096]` and `slopes [n, 3, 4096]` for places `[n, 3, 4096]`; flags: 1 present, 2 open."""
    from loss import CELLS, LENGTH_GUARD, NEIGHBOURS, SIDE

    kernel[(CELLS // BLOCK, len(places))](places, flags, sums, slopes, reach, LENGTH_GUARD, CELLS, SIDE, NEIGHBOURS, BLOCK)
