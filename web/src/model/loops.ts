/** Boundary loops as the editor lists them. */
import type { Loop } from '../client.js';

/** A kind of loop, and how it is named and drawn. The colours are told apart in grey, too, and each kind has its own line. */
export interface KindStyle {
  /** Heading of its group in the panel. */
  readonly plural: string;
  readonly singular: string;
  readonly color: string;
  readonly line: 'solid' | 'dashed' | 'dotted';
}

const STYLES: ReadonlyMap<string, KindStyle> = new Map([
  ['HOLE', { plural: 'Holes', singular: 'Hole', color: '#d9480f', line: 'solid' }],
  ['OPENING', { plural: 'Openings', singular: 'Opening', color: '#9c5fd0', line: 'dotted' }],
  ['TUBE_END', { plural: 'Ends of sleeves', singular: 'End of a sleeve', color: '#37a04d', line: 'dotted' }],
  ['OUTER_BOUNDARY', { plural: 'Borders', singular: 'Border', color: '#3f86c9', line: 'dashed' }],
]);

/** Also for kinds that a newer service may name. */
export function styleOf(kind: string): KindStyle {
  const words = kind.toLowerCase().replaceAll('_', ' ');
  const name = words.charAt(0).toUpperCase() + words.slice(1);
  return STYLES.get(kind) ?? { plural: name, singular: name, color: '#862e9c', line: 'dotted' };
}

/** A kind as what a loop is: `a hole`, `an end of a sleeve`. */
export function kindInWords(kind: string): string {
  const name = styleOf(kind).singular.toLowerCase();
  return `${/^[aeiou]/.test(name) ? 'an' : 'a'} ${name}`;
}

/** What was found in a scan, in a sentence without its end. */
export function foundInWords(loops: readonly Loop[], places: number): string {
  const count = (number: number, one: string, many: string): string => `${number} ${number === 1 ? one : many}`;
  const holes = count(loops.filter(isHole).length, 'hole', 'holes');
  const found = `${holes} in ${count(loops.length, 'boundary loop', 'boundary loops')}`;
  return places === 0
    ? found
    : `${found}, and ${count(places, 'bite, rip or tear', 'bites, rips or tears')} at the border`;
}

/** Whether the service fills a loop unasked. */
export function isHole(loop: Loop): boolean {
  return loop.kind === 'HOLE';
}

/** Whether a loop can be chosen: the cloth's own border stays. */
export function isFillable(loop: Loop): boolean {
  return loop.kind !== 'OUTER_BOUNDARY';
}

/** Kinds in the order of the panel, each with its loops, longest first. */
export function byKind(loops: readonly Loop[]): [string, Loop[]][] {
  const order = [...STYLES.keys()];
  const groups = new Map<string, Loop[]>(order.map((kind) => [kind, []]));
  for (const loop of loops) {
    const kind = loop.kind ?? 'LOOP_KIND_UNSPECIFIED';
    groups.set(kind, [...(groups.get(kind) ?? []), loop]);
  }
  const length = (loop: Loop): number => loop.length ?? 0;
  return [...groups]
    .filter(([, members]) => members.length > 0)
    .map(([kind, members]) => [kind, members.sort((a, b) => length(b) - length(a))]);
}

/** A number for a person: three significant digits. */
export function short(value: number | undefined): string {
  if (value === undefined || !Number.isFinite(value)) {
    return '–';
  }
  if (value !== 0 && (Math.abs(value) >= 1e6 || Math.abs(value) < 1e-3)) {
    return value.toExponential(2);
  }
  return String(Number(value.toPrecision(3)));
}
