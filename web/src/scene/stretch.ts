/** Stretch: lengths in space divided by those of the cloth laid flat. */
import type { Patch } from '../model/scan_session.js';

/** Cells of a grid's side. */
const GRID = 64;

/** The stretch of the cloth around holes, at the cells of their charts. */
export interface StretchCells {
  /** `x, y, z` of each. */
  readonly positions: Float32Array<ArrayBuffer>;
  readonly stretch: Float32Array<ArrayBuffer>;
  /** How far around a cell its value holds, in the scene's unit. */
  readonly reach: number;
}

/** The known cells of the charts of some holes. */
export function stretchCells(patches: readonly Patch[]): StretchCells {
  const positions: number[] = [];
  const stretch: number[] = [];
  let reach = 0;
  for (const { hole } of patches) {
    const { gridPositions = [], knownCells = [], chartSide = 0 } = hole;
    const width = chartSide / GRID;
    const known = new Set(knownCells);
    const at = (cell: number): number[] => gridPositions.slice(3 * cell, 3 * cell + 3);
    for (const cell of width > 0 ? knownCells : []) {
      const column = cell % GRID;
      const neighbours = [column > 0 ? cell - 1 : -1, column + 1 < GRID ? cell + 1 : -1, cell - GRID, cell + GRID];
      const lengths = neighbours.filter((other) => known.has(other)).map((other) => distance(at(cell), at(other)));
      if (lengths.length > 0) {
        positions.push(...at(cell));
        stretch.push(lengths.reduce((sum, length) => sum + length, 0) / lengths.length / width);
        reach = Math.max(reach, 1.2 * width);
      }
    }
  }
  return { positions: new Float32Array(positions), stretch: new Float32Array(stretch), reach };
}

/** For each vertex the stretch at the cell nearest to it; NaN beyond reach of all. */
export function stretchAt(
  vertices: Float32Array,
  { positions, stretch, reach }: StretchCells,
): Float32Array<ArrayBuffer> {
  const found = new Float32Array(vertices.length / 3).fill(Number.NaN);
  const boxes = new Map<string, number[]>();
  const box = (x: number): number => Math.floor(x / reach);
  for (let cell = 0; cell < stretch.length; cell += 1) {
    const key = [0, 1, 2].map((axis) => box(positions[3 * cell + axis] as number)).join();
    const members = boxes.get(key);
    if (members === undefined) {
      boxes.set(key, [cell]);
    } else {
      members.push(cell);
    }
  }
  const bounds = boundsOf(positions, reach);
  for (let vertex = 0; vertex < found.length; vertex += 1) {
    const [x, y, z] = vertices.subarray(3 * vertex, 3 * vertex + 3) as unknown as [number, number, number];
    if (!inside(bounds, x, y, z)) {
      continue;
    }
    let best = reach * reach;
    for (let near = 0; near < 27; near += 1) {
      const key = `${box(x) + (near % 3) - 1},${box(y) + (Math.floor(near / 3) % 3) - 1},${box(z) + Math.floor(near / 9) - 1}`;
      for (const cell of boxes.get(key) ?? []) {
        const away =
          ((positions[3 * cell] as number) - x) ** 2 +
          ((positions[3 * cell + 1] as number) - y) ** 2 +
          ((positions[3 * cell + 2] as number) - z) ** 2;
        if (away < best) {
          best = away;
          found[vertex] = stretch[cell] as number;
        }
      }
    }
  }
  return found;
}

/** For each vertex of a patch the mean stretch of its edges; NaN without a chart. */
export function patchStretch({ hole, positions }: Patch): Float32Array<ArrayBuffer> {
  const { patchFaces = [], patchUvs = [], chartSide = 0 } = hole;
  const count = positions.length / 3;
  const sums = new Float32Array(2 * count);
  const length = (values: ArrayLike<number>, size: number, a: number, b: number): number => {
    let squares = 0;
    for (let axis = 0; axis < size; axis += 1) {
      squares += ((values[size * a + axis] as number) - (values[size * b + axis] as number)) ** 2;
    }
    return Math.sqrt(squares);
  };
  for (let face = 0; face + 2 < patchFaces.length && patchUvs.length > 0; face += 3) {
    for (let side = 0; side < 3; side += 1) {
      const [a, b] = [patchFaces[face + side] as number, patchFaces[face + ((side + 1) % 3)] as number];
      const flat = length(patchUvs, 2, a, b) * chartSide;
      if (flat > 0) {
        for (const vertex of [a, b]) {
          sums[2 * vertex] = (sums[2 * vertex] as number) + length(positions, 3, a, b) / flat;
          sums[2 * vertex + 1] = (sums[2 * vertex + 1] as number) + 1;
        }
      }
    }
  }
  return Float32Array.from(
    { length: count },
    (_, vertex) => (sums[2 * vertex] as number) / (sums[2 * vertex + 1] as number),
  );
}

function distance(a: readonly number[], b: readonly number[]): number {
  return Math.hypot(...a.map((value, axis) => value - (b[axis] as number)));
}

/** The least and the largest coordinates, wider by `reach`. */
function boundsOf(positions: Float32Array, reach: number): Float64Array {
  const bounds = Float64Array.of(Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity);
  positions.forEach((value, at) => {
    const axis = at % 3;
    bounds[axis] = Math.min(bounds[axis] as number, value - reach);
    bounds[3 + axis] = Math.max(bounds[3 + axis] as number, value + reach);
  });
  return bounds;
}

function inside(bounds: Float64Array, ...point: [number, number, number]): boolean {
  return point.every((value, axis) => value >= (bounds[axis] as number) && value <= (bounds[3 + axis] as number));
}
