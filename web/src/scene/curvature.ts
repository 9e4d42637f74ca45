/** Gaussian curvature of a mesh, and how bright its vertices are drawn beside colours that mean something. */

/** Angles above this sum, in radians, are those of a vertex whose cloth is stored twice, once for each side. */
const BOTH_SIDES = 3.2 * Math.PI;

/** Numbers of each vertex of a mesh. */
export interface VertexNumbers {
  /** One over the square of the scene's unit: above 0 on domes, below 0 on saddles; NaN where no inner vertex is near. */
  readonly curvature: Float32Array<ArrayBuffer>;
  /** From 0 to 1. */
  readonly shade: Float32Array<ArrayBuffer>;
}

/**
 * Gaussian curvature: the angle that is missing around a vertex (2π − Σ angles), divided by a third of the area of its triangles, both summed over its
 * triangles' vertices, as scans are noisy. Vertices of a boundary have none of their own and take that of those around.
 *
 * @param positions - `x, y, z` of each vertex.
 * @param triangles - Three vertices each.
 * @param welded - For each vertex the one that stands for all at its position.
 */
export function vertexNumbers(
  positions: Float32Array,
  triangles: ArrayLike<number>,
  welded: Uint32Array,
): VertexNumbers {
  const count = positions.length / 3;
  const angles = new Float64Array(count);
  const areas = new Float64Array(count);
  const normals = new Float32Array(3 * count);
  // Whoever follows a vertex around it precedes it elsewhere, but for a boundary: there the numbers do not cancel.
  const open = new Int32Array(count);
  eachTriangle(triangles, welded, ([a, b, c]) => {
    const normal = crossAt(positions, a, b, c);
    const area = Math.hypot(...normal);
    for (const [here, next, last] of [
      [a, b, c],
      [b, c, a],
      [c, a, b],
    ] as const) {
      angles[here] = (angles[here] as number) + Math.atan2(area, dotAt(positions, here, next, last));
      areas[here] = (areas[here] as number) + area / 6;
      open[here] = ((open[here] as number) + mixed(next) - mixed(last)) | 0;
      for (let axis = 0; axis < 3; axis += 1) {
        normals[3 * here + axis] = (normals[3 * here + axis] as number) + (normal[axis] as number);
      }
    }
  });
  const defects = angles.map((angle, vertex) => {
    if (open[vertex] !== 0 || angle === 0) {
      areas[vertex] = 0;
      return 0;
    }
    if (angle > BOTH_SIDES) {
      areas[vertex] = (areas[vertex] as number) / 2;
      return 2 * Math.PI - angle / 2;
    }
    return 2 * Math.PI - angle;
  });
  const sums = new Float64Array(2 * count);
  eachTriangle(triangles, welded, ([a, b, c]) => {
    const defect = (defects[a] as number) + (defects[b] as number) + (defects[c] as number);
    const area = (areas[a] as number) + (areas[b] as number) + (areas[c] as number);
    for (const vertex of [a, b, c]) {
      sums[2 * vertex] = (sums[2 * vertex] as number) + defect;
      sums[2 * vertex + 1] = (sums[2 * vertex + 1] as number) + area;
    }
  });
  const curvature = new Float32Array(count);
  const shade = new Float32Array(count);
  for (let vertex = 0; vertex < count; vertex += 1) {
    const first = welded[vertex] as number;
    const area = sums[2 * first + 1] as number;
    curvature[vertex] = area > 0 ? (sums[2 * first] as number) / area : Number.NaN;
    shade[vertex] = shadeOf(normals.subarray(3 * first, 3 * first + 3));
  }
  return { curvature, shade };
}

/** From where the light comes that shows folds. */
const LIGHT = [0.39, 0.49, 0.78] as const;

function shadeOf([x = 0, y = 0, z = 0]: Float32Array): number {
  const length = Math.hypot(x, y, z) || 1;
  return Math.abs(x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2]) / length;
}

function eachTriangle(
  triangles: ArrayLike<number>,
  welded: Uint32Array,
  visit: (corners: [number, number, number]) => void,
): void {
  const corner = (index: number): number => welded[triangles[index] as number] as number;
  for (let at = 0; at + 2 < triangles.length; at += 3) {
    const [a, b, c] = [corner(at), corner(at + 1), corner(at + 2)];
    if (a !== b && b !== c && c !== a) {
      visit([a, b, c]);
    }
  }
}

function mixed(vertex: number): number {
  const hash = Math.imul(vertex + 1, 0x9e3779b1);
  return hash ^ (hash >>> 15);
}

/** The vector product of two sides of a triangle. */
function crossAt(p: Float32Array, a: number, b: number, c: number): [number, number, number] {
  const side = (to: number, axis: number): number => (p[3 * to + axis] as number) - (p[3 * a + axis] as number);
  const [x1, y1, z1, x2, y2, z2] = [side(b, 0), side(b, 1), side(b, 2), side(c, 0), side(c, 1), side(c, 2)];
  return [y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2];
}

/** The scalar product of the sides that meet at `a`. */
function dotAt(p: Float32Array, a: number, b: number, c: number): number {
  const side = (to: number, axis: number): number => (p[3 * to + axis] as number) - (p[3 * a + axis] as number);
  return side(b, 0) * side(c, 0) + side(b, 1) * side(c, 1) + side(b, 2) * side(c, 2);
}
