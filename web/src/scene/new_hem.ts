/** Lines of new hem, as the service lays them (crates/mend/src/hem_strip.rs). */
import type { Vec3 } from '../client.js';
import type { ClothEdge } from './cloth_edge.js';
import { distanceOf, lengthOf, moved, way } from './vectors.js';

/** Edges of the hem on each side that its direction is taken from. */
const HEM = 8;
/** Most points of a line. */
const MOST_POINTS = 4096;
/** Chords that the length of a curve is measured by. */
const CHORDS = 64;

/** A hem that goes on from the end of a stretch, away from it: along its loop (1) or against it (-1), so many edges. */
export interface HemEnd {
  readonly edge: ClothEdge;
  readonly vertex: number;
  readonly step: 1 | -1;
  readonly edges: number;
}

/** The line from one hem to another: through points, or, without any, on from both. */
export function hemLine(before: HemEnd, after: HemEnd, along: readonly Vec3[] = []): Vec3[] {
  const seen = [seenOf(before), seenOf(after)];
  const edges = seen.reduce((sum, points) => sum + points.length - 1, 0);
  const edge = seen.reduce((sum, points) => sum + lengthOf(points), 0) / edges;
  const [from, to] = [placeOf(before, 0), placeOf(after, 0)];
  const line = along.length === 0 ? curveOf(before, after, edge) : throughPoints([from, ...along, to], edge);
  return line.filter((point, at) => at === 0 || distanceOf(point, line[at - 1] as Vec3) > 0);
}

/** The place after so many edges of a hem. */
export function placeOf({ edge, vertex, step }: HemEnd, edges: number): Vec3 {
  return edge.place(vertex + step * edges);
}

/** The places that a hem's direction and the length of its edges are taken from. */
function seenOf(end: HemEnd): Vec3[] {
  const edges = Math.max(Math.min(HEM, Math.floor((end.edges - 1) / 2)), 1);
  return Array.from({ length: edges + 1 }, (_, at) => placeOf(end, at));
}

/** A cubic curve by its ends and its directions there. */
function curveOf(before: HemEnd, after: HemEnd, edge: number): Vec3[] {
  const [from, to] = [placeOf(before, 0), placeOf(after, 0)];
  const chord = distanceOf(from, to);
  const [leaving, arriving] = [scaled(directionOf(before), -chord), scaled(directionOf(after), chord)];
  const at = (t: number): Vec3 => {
    const [t2, t3] = [t * t, t * t * t];
    const parts: [Vec3, number][] = [
      [from, 2 * t3 - 3 * t2 + 1],
      [leaving, t3 - 2 * t2 + t],
      [to, 3 * t2 - 2 * t3],
      [arriving, t3 - t2],
    ];
    return parts.reduce<Vec3>((sum, [part, share]) => moved(sum, part, share), [0, 0, 0]);
  };
  const points = (count: number): Vec3[] => Array.from({ length: count + 1 }, (_, k) => at(k / count));
  return points(pieces(lengthOf(points(CHORDS)), edge)).with(-1, to);
}

function throughPoints(corners: readonly Vec3[], edge: number): Vec3[] {
  const line = corners.slice(0, 1);
  for (const [at, corner] of corners.slice(1).entries()) {
    const start = corners[at] as Vec3;
    const count = pieces(distanceOf(start, corner), edge);
    for (let k = 1; k <= count; k += 1) {
      line.push(moved(start, way(start, corner), k / count));
    }
    if (line.length > MOST_POINTS) {
      break;
    }
  }
  return line.with(-1, corners.at(-1) as Vec3);
}

/** The direction of a hem at the end of the stretch, away from the stretch. */
function directionOf(end: HemEnd): Vec3 {
  const seen = seenOf(end);
  const along = way(seen[0] as Vec3, seen.at(-1) as Vec3);
  const length = Math.hypot(...along);
  return length > 0 ? scaled(along, 1 / length) : [0, 0, 0];
}

function scaled(vector: Vec3, by: number): Vec3 {
  return moved([0, 0, 0], vector, by);
}

/** Edges of about this length that a line of another length is divided into. */
function pieces(length: number, edge: number): number {
  const count = Math.round(length / edge);
  return Number.isFinite(count) ? Math.min(Math.max(count, 1), MOST_POINTS) : 1;
}
