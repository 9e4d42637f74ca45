/** The plausible fills of holes, by number and in words. */
import type { Report } from '../client.js';

/** How many fills each hole has; the constraint `alternative` counts them from 0, the likeliest. */
export const FILLS = 8;

/** Whether a value is the number of a fill. */
export function isFill(value: unknown): value is number {
  return Number.isInteger(value) && (value as number) >= 0 && (value as number) < FILLS;
}

/** What a fill is called, counted from 1. */
export function fillName(alternative: number): string {
  return `Fill ${alternative + 1} of ${FILLS}`;
}

/** A fill that was applied, in one or two sentences; with the report, also whether the holes have it. */
export function fillInWords(alternative: number, report?: Report): string {
  const only = onlyFillInWords(alternative, report);
  const place = alternative === 0 ? 'the likeliest' : 'beside the likeliest';
  return only === undefined ? `${fillName(alternative)}, ${place}.` : `${fillName(alternative)}. ${only}`;
}

/** Why the cloth is the same as that of the first fill; undefined where it is not, and where the first was asked for. */
export function onlyFillInWords(alternative: number, report?: Report): string | undefined {
  const holes = report?.holes ?? [];
  if (alternative === 0 || holes.length === 0 || holes.some(({ patch }) => (patch?.alternative ?? 0) > 0)) {
    return undefined;
  }
  return holes.length === 1
    ? 'A smooth surface closes this hole: it has one fill only, which is shown.'
    : 'Smooth surfaces close these holes: each has one fill only, which is shown.';
}
