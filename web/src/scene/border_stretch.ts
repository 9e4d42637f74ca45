/** Stretches of the cloth's own edge, as the service takes them: by the nearest vertices, the shorter way. */
import type { Vec3 } from '../client.js';
import type { EdgeEnds } from '../model/draft.js';
import type { BoundaryLine } from './boundary.js';

/**
 * The way along the line that comes nearest to `from`, to its vertex nearest to `to`: the shorter one, or that which lies nearer to the ends of the
 * edge that faces it.
 */
export function stretchBetween(lines: Iterable<BoundaryLine>, { from, to }: EdgeEnds, facing?: EdgeEnds): Vec3[] {
  let best: { points: Vec3[]; at: number; distance: number } | undefined;
  for (const line of lines) {
    const points = pointsOf(line);
    const { at, distance } = nearest(points, from);
    if (distance < (best?.distance ?? Number.POSITIVE_INFINITY)) {
      best = { points, at, distance };
    }
  }
  if (best === undefined) {
    return [];
  }
  const { points, at } = best;
  const end = nearest(points, to).at;
  const count = points.length;
  const way = (step: 1 | -1): Vec3[] => {
    const stretch = [points[at] as Vec3];
    for (let place = at; place !== end;) {
      place = (place + step + count) % count;
      stretch.push(points[place] as Vec3);
    }
    return stretch;
  };
  const [forth, back] = [way(1), way(-1)];
  const cost = (stretch: readonly Vec3[]): number =>
    facing === undefined ? lengthOf(stretch) : meanDistance(stretch, facing);
  return cost(forth) <= cost(back) ? forth : back;
}

/** The vertices of a boundary. */
export function pointsOf({ points }: BoundaryLine): Vec3[] {
  return Array.from({ length: points.length / 3 }, (_, at) => [...points.subarray(3 * at, 3 * at + 3)] as Vec3);
}

function nearest(points: readonly Vec3[], to: Vec3): { at: number; distance: number } {
  let best = { at: 0, distance: Number.POSITIVE_INFINITY };
  points.forEach((point, at) => {
    const distance = distanceOf(point, to);
    if (distance < best.distance) {
      best = { at, distance };
    }
  });
  return best;
}

function meanDistance(points: readonly Vec3[], { from, to }: EdgeEnds): number {
  const line = [0, 1, 2].map((axis) => (to[axis] as number) - (from[axis] as number)) as Vec3;
  const square = line[0] ** 2 + line[1] ** 2 + line[2] ** 2;
  const each = points.map((point) => {
    const along = line.reduce(
      (sum, value, axis) => sum + value * ((point[axis] as number) - (from[axis] as number)),
      0,
    );
    const share = square > 0 ? Math.min(Math.max(along / square, 0), 1) : 0;
    return distanceOf(point, from.map((value, axis) => value + share * (line[axis] as number)) as Vec3);
  });
  return each.reduce((sum, distance) => sum + distance, 0) / points.length;
}

function lengthOf(points: readonly Vec3[]): number {
  return points.reduce((sum, point, at) => sum + distanceOf(point, points[Math.max(at - 1, 0)] as Vec3), 0);
}

function distanceOf(a: Vec3, b: Vec3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}
