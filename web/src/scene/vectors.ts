/** Points and directions as three numbers. */
import type { Vec3 } from '../client.js';

/** What leads from a point to another. */
export function way(from: Vec3, to: Vec3): Vec3 {
  return [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
}

/** A point, moved so many times along a direction. */
export function moved([x, y, z]: Vec3, along: Vec3, times: number): Vec3 {
  return [x + times * along[0], y + times * along[1], z + times * along[2]];
}

export function dotOf(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function distanceOf(a: Vec3, b: Vec3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/** How far a point is from the straight line between two others. */
export function distanceToLine(point: Vec3, from: Vec3, to: Vec3): number {
  const line = way(from, to);
  const square = dotOf(line, line);
  const share = square > 0 ? dotOf(way(from, point), line) / square : 0;
  return distanceOf(point, moved(from, line, Math.min(Math.max(share, 0), 1)));
}

/** The length of a line through points. */
export function lengthOf(points: readonly Vec3[]): number {
  return points.reduce((sum, point, at) => sum + distanceOf(point, points[at - 1] ?? point), 0);
}
