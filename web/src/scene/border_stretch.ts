/** Stretches of the cloth's own edge, as the service takes them: by the nearest vertices, the shorter way. */
import type { Vec3 } from '../client.js';
import type { BoundaryLine } from './boundary.js';

/** The shorter way along the line that comes nearest to `from`, to its vertex nearest to `to`. */
export function stretchBetween(lines: Iterable<BoundaryLine>, from: Vec3, to: Vec3): Vec3[] {
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
  return lengthOf(forth) <= lengthOf(back) ? forth : back;
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

function lengthOf(points: readonly Vec3[]): number {
  return points.reduce((sum, point, at) => sum + distanceOf(point, points[Math.max(at - 1, 0)] as Vec3), 0);
}

function distanceOf(a: Vec3, b: Vec3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}
