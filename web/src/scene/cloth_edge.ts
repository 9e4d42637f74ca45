/** Boundary loops of the cloth, and stretches of them. */
import type { Loop, Vec3 } from '../client.js';
import type { BoundaryLine } from './boundary.js';
import { lengthOf } from './vectors.js';

/** Radians from a bite's turning within which a stretch is one, and by which the longer of two ways must be nearer to it before it is taken. */
const SURELY_A_BITE = 1.5;

/** A boundary loop. Its vertices are counted round and round. */
export class ClothEdge {
  readonly count: number;
  /** Whether it goes round an opening or the end of a tube. */
  readonly goesRound: boolean;
  /** What noise adds to the turning at each vertex, radians: what the turnings sum up to beyond the loop's own. */
  private readonly noise: number;

  constructor(
    private readonly line: BoundaryLine,
    { kind, turning = 0 }: Pick<Loop, 'kind' | 'turning'>,
  ) {
    this.count = line.points.length / 3;
    this.goesRound = kind === 'OPENING' || kind === 'TUBE_END';
    const sum = line.angles.reduce((before, angle) => before + Math.PI - angle, 0);
    this.noise = (sum - turning) / this.count;
  }

  place(vertex: number): Vec3 {
    const at = 3 * (((vertex % this.count) + this.count) % this.count);
    const { points } = this.line;
    return [points[at] as number, points[at + 1] as number, points[at + 2] as number];
  }

  /** How much the loop turns at a vertex, radians, without noise. */
  turning(vertex: number): number {
    return Math.PI - (this.line.angles[vertex % this.count] as number) - this.noise;
  }

  /** Edges from a vertex on to another. */
  ahead(from: number, to: number): number {
    return (((to - from) % this.count) + this.count) % this.count;
  }

  /** The vertex nearest to a point. */
  nearest([x, y, z]: Vec3): { readonly vertex: number; readonly distance: number } {
    const { points } = this.line;
    let best = { vertex: 0, square: Number.POSITIVE_INFINITY };
    for (let vertex = 0; vertex < this.count; vertex += 1) {
      const at = 3 * vertex;
      const [dx, dy, dz] = [(points[at] as number) - x, (points[at + 1] as number) - y, (points[at + 2] as number) - z];
      const square = dx * dx + dy * dy + dz * dz;
      if (square < best.square) {
        best = { vertex, square };
      }
    }
    return { vertex: best.vertex, distance: Math.sqrt(best.square) };
  }
}

/** A stretch of a loop: from a vertex on, so many edges. */
export class Stretch {
  constructor(
    readonly edge: ClothEdge,
    readonly from: number,
    readonly edges: number,
  ) {}

  /** Its last vertex. */
  get to(): number {
    return (this.from + this.edges) % this.edge.count;
  }

  /** Edges of the loop that do not belong to it. */
  get rest(): number {
    return this.edge.count - this.edges;
  }

  get places(): Vec3[] {
    return Array.from({ length: this.edges + 1 }, (_, at) => this.edge.place(this.from + at));
  }

  get length(): number {
    return lengthOf(this.places);
  }

  /** Whether it leads into the cloth and back. */
  get isBite(): boolean {
    return this.offABite < SURELY_A_BITE;
  }

  /** How far the turning between its ends is from that of a way into the cloth and back, which is −π, radians. */
  get offABite(): number {
    let turning = 0;
    for (let at = 1; at < this.edges; at += 1) {
      turning += this.edge.turning(this.from + at);
    }
    return Math.abs(turning + Math.PI);
  }

  /** Whether both have a vertex of a loop in common. */
  overlaps(other: Stretch): boolean {
    const within = (stretch: Stretch, vertex: number): boolean =>
      this.edge.ahead(stretch.from, vertex) <= stretch.edges;
    return this.edge === other.edge && (within(this, other.from) || within(other, this.from));
  }
}

/** Of the two ways along a loop that which leads into the cloth; the shorter one where that is not sure. */
export function intoCloth([on, back]: readonly [Stretch, Stretch]): Stretch {
  const [shorter, longer] = on.length <= back.length ? [on, back] : [back, on];
  return longer.offABite + SURELY_A_BITE < shorter.offABite ? longer : shorter;
}
