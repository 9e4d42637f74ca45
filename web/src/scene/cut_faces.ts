/** Finds the triangles that the service cut out of a scan: it names each by its middle, as files number triangles in their own ways. */

/** Middles of triangles, to be looked up. */
export class Middles {
  /** `x, y, z` of each, by x. */
  private readonly sorted: Float64Array;

  /**
   * @param middles - `x, y, z` of each.
   * @param slack - How far a middle may lie from that of its triangle, as both were rounded.
   */
  constructor(
    middles: readonly number[],
    private readonly slack: number,
  ) {
    const x = (point: number): number => middles[3 * point] as number;
    const order = Array.from({ length: middles.length / 3 }, (_, point) => point).sort((a, b) => x(a) - x(b));
    this.sorted = Float64Array.from(order.flatMap((point) => middles.slice(3 * point, 3 * point + 3)));
  }

  /** Whether one of them lies at a point. */
  has(x: number, y: number, z: number): boolean {
    const { sorted, slack } = this;
    let [low, high] = [0, sorted.length / 3];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((sorted[3 * middle] as number) < x - slack) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    for (let at = 3 * low; at < sorted.length && (sorted[at] as number) <= x + slack; at += 3) {
      if (Math.abs((sorted[at + 1] as number) - y) <= slack && Math.abs((sorted[at + 2] as number) - z) <= slack) {
        return true;
      }
    }
    return false;
  }
}

/**
 * An index list without the triangles at some middles. They stay in it as triangles of one vertex, which are neither drawn nor hit, so that a tree over
 * the list stays right; undefined when none of the triangles is meant.
 *
 * @param positions - `x, y, z` of each vertex.
 */
export function indexWithout(positions: Float64Array, index: Uint32Array, middles: Middles): Uint32Array | undefined {
  let left: Uint32Array | undefined;
  const at = (vertex: number, axis: number): number => positions[3 * vertex + axis] as number;
  for (let corner = 0; corner + 2 < index.length; corner += 3) {
    const [a, b, c] = [index[corner], index[corner + 1], index[corner + 2]] as [number, number, number];
    const middle = (axis: number): number => (at(a, axis) + at(b, axis) + at(c, axis)) / 3;
    if (middles.has(middle(0), middle(1), middle(2))) {
      left ??= index.slice();
      left.fill(index[corner] as number, corner, corner + 3);
    }
  }
  return left;
}
