/** Places on new cloth: from uv to position, in plain numbers. */
import type { Uv, Vec3 } from '../client.js';
import type { Patch } from './scan_session.js';

/** A place on a patch, whatever the patch's present shape. */
export interface ClothPoint {
  readonly hole: number;
  readonly uv: Uv;
  /** The triangle, and the barycentric coordinates in it. */
  readonly vertices: Vec3;
  readonly weights: Vec3;
}

/** Whether a patch has a chart: cloth that cannot be laid flat has none, and then no place on the patch has a uv. */
export function hasChart({ hole }: Patch): boolean {
  return (hole.patchUvs?.length ?? 0) > 0;
}

/** The place at a uv; undefined outside the patch, and without a chart. */
export function locate(patch: Patch, uv: Uv): ClothPoint | undefined {
  if (!hasChart(patch)) {
    return undefined;
  }
  const { patchFaces = [], patchUvs = [], id = 0 } = patch.hole;
  const corner = (vertex: number): Uv => [patchUvs[2 * vertex] as number, patchUvs[2 * vertex + 1] as number];
  for (let face = 0; face + 2 < patchFaces.length; face += 3) {
    const vertices = patchFaces.slice(face, face + 3) as Vec3;
    const weights = planarWeights(uv, vertices.map(corner) as [Uv, Uv, Uv]);
    if (weights !== undefined) {
      return { hole: id, uv, vertices, weights };
    }
  }
  return undefined;
}

/** Where a place is in space. */
export function positionOf({ positions }: Patch, { vertices, weights }: ClothPoint): Vec3 {
  return [0, 1, 2].map((axis) =>
    vertices.reduce((sum, vertex, i) => sum + (weights[i] as number) * (positions[3 * vertex + axis] as number), 0),
  ) as Vec3;
}

/** The unit normal of the triangle at a place; zero where the triangle has no area. */
export function normalOf({ positions }: Patch, { vertices }: ClothPoint): Vec3 {
  const [a, b, c] = vertices.map((vertex) => [...positions.subarray(3 * vertex, 3 * vertex + 3)]) as [Vec3, Vec3, Vec3];
  const [p, q] = [difference(b, a), difference(c, a)];
  const normal: Vec3 = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
  const length = Math.hypot(...normal) || 1;
  return normal.map((value) => value / length) as Vec3;
}

/** The place nearest to the middle of the chart's hole. */
export function middleOf(patch: Patch): Uv {
  const { rimUvs = [] } = patch.hole;
  const count = rimUvs.length / 2 || 1;
  const mean = [0, 1].map((axis) => rimUvs.reduce((sum, value, i) => (i % 2 === axis ? sum + value : sum), 0) / count);
  const uvs = patch.hole.patchUvs ?? [];
  let best = { uv: mean as Uv, distance: Number.POSITIVE_INFINITY };
  for (let at = 0; at + 1 < uvs.length; at += 2) {
    const uv: Uv = [uvs[at] as number, uvs[at + 1] as number];
    const distance = Math.hypot(uv[0] - (mean[0] as number), uv[1] - (mean[1] as number));
    if (distance < best.distance) {
      best = { uv, distance };
    }
  }
  return best.uv;
}

/** The patch whose rim comes nearest to a point. */
export function nearestPatch(patches: readonly Patch[], point: Vec3): Patch | undefined {
  let best: { patch: Patch; distance: number } | undefined;
  for (const patch of patches) {
    const rim = patch.hole.rimPositions ?? [];
    for (let at = 0; at + 2 < rim.length; at += 3) {
      const distance = Math.hypot(...difference(rim.slice(at, at + 3) as Vec3, point));
      if (distance < (best?.distance ?? Number.POSITIVE_INFINITY)) {
        best = { patch, distance };
      }
    }
  }
  return best?.patch;
}

function difference(a: Vec3, b: Vec3): Vec3 {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

/** Barycentric coordinates of a point in a triangle of the plane; undefined outside it. */
function planarWeights([u, v]: Uv, [a, b, c]: [Uv, Uv, Uv]): Vec3 | undefined {
  const area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
  if (area === 0) {
    return undefined;
  }
  const second = ((u - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (v - a[1])) / area;
  const third = ((b[0] - a[0]) * (v - a[1]) - (u - a[0]) * (b[1] - a[1])) / area;
  const first = 1 - second - third;
  // A point on an edge belongs to the triangles on both sides, whatever the rounding.
  const slack = -1e-6;
  return first >= slack && second >= slack && third >= slack ? [first, second, third] : undefined;
}
