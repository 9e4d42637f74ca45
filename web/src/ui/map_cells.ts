/** The map of an anchor search: the loss of every cell of the hole as a colour. */
import { type TemplateResult, svg } from '../vendor.js';

/** Cells of a grid's side. */
const GRID = 64;

/** From the least loss to the largest; told apart by lightness alone, too. */
const COLORS: readonly (readonly [number, number, number])[] = [
  [253, 231, 37],
  [53, 183, 121],
  [49, 104, 142],
  [68, 1, 84],
];

/** The least and the largest loss of a map. */
export interface LossRange {
  readonly least: number;
  readonly most: number;
}

/** The range of a map's losses; undefined without any. A cell outside the hole has none. */
export function rangeOf(map: readonly (number | null)[]): LossRange | undefined {
  const losses = map.filter((loss) => loss !== null && Number.isFinite(loss)) as number[];
  return losses.length === 0
    ? undefined
    : { least: losses.reduce((a, b) => Math.min(a, b)), most: losses.reduce((a, b) => Math.max(a, b)) };
}

/** The cells as squares of a drawing whose side is `side`; v goes up. Colours go by the loss's logarithm. */
export function mapCells(map: readonly (number | null)[], { least, most }: LossRange, side: number): TemplateResult[] {
  const cell = side / GRID;
  // So that a loss of zero has a logarithm.
  const floor = Math.max(most * 1e-6, Number.MIN_VALUE);
  const height = (loss: number): number => Math.log(loss + floor);
  const [low, high] = [height(least), height(most)];
  return map.flatMap((loss, index) => {
    if (loss === null || !Number.isFinite(loss)) {
      return [];
    }
    const [i, j] = [index % GRID, Math.floor(index / GRID)];
    const color = colorOf(high > low ? (height(loss) - low) / (high - low) : 0);
    return [
      svg`<rect x=${i * cell} y=${side - (j + 1) * cell} width=${cell} height=${cell} shape-rendering="crispEdges" fill=${color} />`,
    ];
  });
}

function colorOf(share: number): string {
  const place = Math.min(Math.max(share, 0), 1) * (COLORS.length - 1);
  const from = Math.min(Math.floor(place), COLORS.length - 2);
  const [a, b] = [COLORS[from], COLORS[from + 1]] as [readonly number[], readonly number[]];
  const mixed = a.map((value, channel) => Math.round(value + ((b[channel] as number) - value) * (place - from)));
  return `rgb(${mixed.join()})`;
}
