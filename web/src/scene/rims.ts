/** Boundary loops as lines: the kind gives the colour and whether a line is solid, dashed or dotted. Chosen ones are wider. */
import type { Loop } from '../client.js';
import { styleOf } from '../model/loops.js';
import { Box3, Group, Line2, LineGeometry, LineMaterial, Vector3 } from '../vendor.js';
import type { BoundaryLine } from './boundary.js';
import { ClothEdge } from './cloth_edge.js';

/** Width of a line in CSS pixels. */
const WIDTH = { chosen: 4, other: 2 };

/** How a loop lies in space. */
export interface RimView {
  readonly bounds: Box3;
  /** The direction from which the cloth around the loop shows its front; zero for a loop that encloses no area. */
  readonly front: Vector3;
}

/** The lines of a scan's loops. */
export class Rims {
  readonly group = new Group();
  private readonly lines = new Map<number, Line2>();
  private readonly views = new Map<number, RimView>();
  /** The loops as edges of the cloth that can be mended, of whatever kind: a bitten opening may be taken for a hole. */
  readonly edges: readonly ClothEdge[];
  /** The vertices of all of them. */
  readonly vertices: readonly Vector3[];

  /**
   * @param lines - The line of each loop by its id.
   * @param size - The scan's size, for the length of dashes.
   */
  constructor(loops: readonly Loop[], lines: ReadonlyMap<number, BoundaryLine>, size: number) {
    const found = loops.flatMap((loop) => {
      const line = lines.get(loop.id ?? 0);
      return line === undefined ? [] : [{ loop, line }];
    });
    this.edges = found.map(({ loop, line }) => new ClothEdge(line, loop));
    this.vertices = found.flatMap(({ line }) => verticesOf(line));
    for (const { loop, line } of found) {
      const style = styleOf(loop.kind ?? '');
      const dash = size * (style.line === 'dotted' ? 0.003 : 0.012);
      const material = new LineMaterial({
        color: style.color,
        linewidth: WIDTH.other,
        dashed: style.line !== 'solid',
        dashSize: dash,
        gapSize: style.line === 'dotted' ? 2 * dash : 0.7 * dash,
      });
      const geometry = new LineGeometry();
      geometry.setPositions([...line.points, ...line.points.subarray(0, 3)]);
      const drawn = new Line2(geometry, material);
      drawn.computeLineDistances();
      this.lines.set(loop.id ?? 0, drawn);
      this.views.set(loop.id ?? 0, viewOf(line, loop.kind));
      this.group.add(drawn);
    }
  }

  /** Draws the chosen loops wider. */
  choose(chosen: ReadonlySet<number>): void {
    for (const [id, line] of this.lines) {
      line.material.linewidth = chosen.has(id) ? WIDTH.chosen : WIDTH.other;
    }
  }

  setVisible(visible: boolean): void {
    this.group.visible = visible;
  }

  /** How a loop lies in space; undefined where it has no line. */
  viewOf(loop: number): RimView | undefined {
    return this.views.get(loop);
  }

  dispose(): void {
    for (const line of this.lines.values()) {
      line.geometry.dispose();
      line.material.dispose();
    }
  }
}

function verticesOf({ points }: BoundaryLine): Vector3[] {
  return Array.from({ length: points.length / 3 }, (_, at) => new Vector3().fromArray(points, 3 * at));
}

function viewOf(line: BoundaryLine, kind: string | undefined): RimView {
  const corners = verticesOf(line);
  const bounds = new Box3().setFromPoints(corners);
  const center = bounds.getCenter(new Vector3());
  const front = new Vector3();
  corners.forEach((corner, at) => {
    const next = corners[(at + 1) % corners.length] as Vector3;
    front.add(corner.clone().sub(center).cross(next.clone().sub(center)));
  });
  // Its triangles lie to the left of a boundary: a border goes around them, a hole the other way.
  return { bounds, front: kind === 'HOLE' ? front.negate().normalize() : front.normalize() };
}
