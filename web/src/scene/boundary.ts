/** Boundary loops of a mesh, for drawing: the service names loops, but sends the rims of the filled holes only. */

/** A closed line: `x, y, z` of each vertex in order. */
export interface BoundaryLine {
  readonly points: Float32Array;
  /** Per vertex the sum of its triangles' angles there, radians. */
  readonly angles: Float32Array;
  /** Mean of the line, weighted by edge length. */
  readonly centroid: readonly [number, number, number];
  readonly length: number;
}

/**
 * The boundary loops of triangles, vertices at the same position taken as one, as the service does.
 *
 * @param positions - `x, y, z` of each vertex.
 * @param triangles - Three vertices each; triangles with two equal vertices are left out.
 */
export function boundaryLines(positions: Float32Array, triangles: Uint32Array): BoundaryLine[] {
  const welded = weld(positions);
  const loops = loopsOf(boundaryEdges(welded, triangles, positions.length / 3));
  const angles = anglesAt(new Set(loops.flat()), { positions, welded, triangles });
  return loops.map((loop) => ({
    ...lineOf(positions, loop),
    angles: Float32Array.from(loop, (at) => angles[at] ?? 0),
  }));
}

/** Per vertex the sum of the angles of its triangles, radians; 0 for vertices that are not asked for. */
function anglesAt(
  asked: ReadonlySet<number>,
  { positions, welded, triangles }: Record<'positions', Float32Array> & Record<'welded' | 'triangles', Uint32Array>,
): Float32Array {
  const isAsked = new Uint8Array(positions.length / 3);
  asked.forEach((vertex) => (isAsked[vertex] = 1));
  const sums = new Float32Array(positions.length / 3);
  const side = (from: number, to: number): number[] =>
    [0, 1, 2].map((axis) => (positions[3 * to + axis] as number) - (positions[3 * from + axis] as number));
  for (let face = 0; face + 2 < triangles.length; face += 3) {
    const corners = [0, 1, 2].map((corner) => welded[triangles[face + corner] as number] as number);
    for (let corner = 0; corner < 3; corner += 1) {
      const vertex = corners[corner] as number;
      if (isAsked[vertex] === 1) {
        const [a, b] = [1, 2].map((step) => side(vertex, corners[(corner + step) % 3] as number)) as [
          number[],
          number[],
        ];
        const cosine = dot(a, b) / Math.sqrt(dot(a, a) * dot(b, b));
        sums[vertex] =
          (sums[vertex] as number) + (Number.isNaN(cosine) ? 0 : Math.acos(Math.min(Math.max(cosine, -1), 1)));
      }
    }
  }
  return sums;
}

function dot(a: readonly number[], b: readonly number[]): number {
  return a.reduce((sum, value, axis) => sum + value * (b[axis] as number), 0);
}

/** For each vertex, the first one at its position: by a hash table with open addressing over the positions' bits. */
export function weld(positions: Float32Array): Uint32Array {
  const count = positions.length / 3;
  const slots = 2 ** Math.ceil(Math.log2(2 * count + 1));
  const table = new Int32Array(slots).fill(-1);
  // Adding zero makes negative zeros positive, so that equal positions have equal bits.
  const bits = new Uint32Array(positions.map((value) => value + 0).buffer);
  const equal = (a: number, b: number): boolean =>
    bits[3 * a] === bits[3 * b] && bits[3 * a + 1] === bits[3 * b + 1] && bits[3 * a + 2] === bits[3 * b + 2];
  const welded = new Uint32Array(count);
  for (let vertex = 0; vertex < count; vertex += 1) {
    let hash = 0;
    for (let axis = 0; axis < 3; axis += 1) {
      hash = Math.imul(hash ^ (bits[3 * vertex + axis] as number), 0x9e3779b1);
      hash ^= hash >>> 15;
    }
    let slot = hash & (slots - 1);
    for (let other = table[slot] as number; other >= 0 && !equal(other, vertex); other = table[slot] as number) {
      slot = (slot + 1) & (slots - 1);
    }
    if ((table[slot] as number) < 0) {
      table[slot] = vertex;
    }
    welded[vertex] = table[slot] as number;
  }
  return welded;
}

/** The edges with a triangle on one side only, as a map from each vertex to those that follow it. */
function boundaryEdges(welded: Uint32Array, triangles: Uint32Array, count: number): Map<number, number[]> {
  // An edge as a number, its lower vertex first: exact in a double for any mesh that fits into memory.
  const keys = new Float64Array(triangles.length);
  const directed = new Map<number, [number, number]>();
  const corner = (index: number): number => welded[triangles[index] as number] as number;
  let used = 0;
  const each = (visit: (from: number, to: number) => void): void => {
    for (let face = 0; face + 2 < triangles.length; face += 3) {
      const [a, b, c] = [corner(face), corner(face + 1), corner(face + 2)];
      if (a !== b && b !== c && c !== a) {
        visit(a, b);
        visit(b, c);
        visit(c, a);
      }
    }
  };
  const keyOf = (from: number, to: number): number => Math.min(from, to) * count + Math.max(from, to);
  each((from, to) => {
    keys[used] = keyOf(from, to);
    used += 1;
  });
  const sorted = keys.subarray(0, used).sort();
  const single = new Set<number>();
  for (let at = 0; at < used; at += 1) {
    if (sorted[at] !== sorted[at - 1] && sorted[at] !== sorted[at + 1]) {
      single.add(sorted[at] as number);
    }
  }
  each((from, to) => {
    const key = keyOf(from, to);
    if (single.has(key)) {
      directed.set(key, [from, to]);
    }
  });
  const following = new Map<number, number[]>();
  for (const [from, to] of directed.values()) {
    following.set(from, [...(following.get(from) ?? []), to]);
  }
  return following;
}

/** Chains edges to loops. At a vertex with several, any is taken. */
function loopsOf(following: Map<number, number[]>): number[][] {
  const loops: number[][] = [];
  for (const start of following.keys()) {
    for (;;) {
      const loop: number[] = [];
      let vertex: number | undefined = start;
      while (vertex !== undefined) {
        const next: number | undefined = following.get(vertex)?.pop();
        if (next === undefined) {
          break;
        }
        loop.push(vertex);
        vertex = next;
      }
      if (loop.length === 0) {
        break;
      }
      loops.push(loop);
    }
  }
  return loops.filter((loop) => loop.length > 2);
}

function lineOf(positions: Float32Array, loop: readonly number[]): Omit<BoundaryLine, 'angles'> {
  const points = new Float32Array(loop.flatMap((vertex) => [...positions.subarray(3 * vertex, 3 * vertex + 3)]));
  const centroid: [number, number, number] = [0, 0, 0];
  let length = 0;
  for (let at = 0; at < loop.length; at += 1) {
    const from = points.subarray(3 * at, 3 * at + 3);
    const next = 3 * ((at + 1) % loop.length);
    const to = points.subarray(next, next + 3);
    const edge = Math.hypot(...[0, 1, 2].map((axis) => (to[axis] as number) - (from[axis] as number)));
    length += edge;
    for (const axis of [0, 1, 2] as const) {
      centroid[axis] += (edge * ((from[axis] as number) + (to[axis] as number))) / 2;
    }
  }
  for (const axis of [0, 1, 2] as const) {
    centroid[axis] /= length || 1;
  }
  return { points, centroid, length };
}

/** A loop as the service names it. */
interface NamedLoop {
  readonly id?: number;
  readonly centroid?: readonly number[];
  readonly length?: number;
}

/** For each of the service's loops, the nearest line that is about as long; loops without one are left out. */
export function linesOfLoops(loops: readonly NamedLoop[], lines: readonly BoundaryLine[]): Map<number, BoundaryLine> {
  const free = new Set(lines);
  const found = new Map<number, BoundaryLine>();
  for (const loop of loops) {
    const { centroid = [], length = 0 } = loop;
    let best: { line: BoundaryLine; cost: number } | undefined;
    for (const line of free) {
      const away = Math.hypot(...line.centroid.map((value, axis) => value - (centroid[axis] ?? 0)));
      const cost = (away + Math.abs(line.length - length)) / (length || 1);
      if (cost < (best?.cost ?? 0.05)) {
        best = { line, cost };
      }
    }
    if (best !== undefined) {
      free.delete(best.line);
      found.set(loop.id ?? 0, best.line);
    }
  }
  return found;
}
