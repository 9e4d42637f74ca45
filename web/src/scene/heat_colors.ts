/** From numbers to colours: blue below the middle, orange above, told apart by people who see no red or green, and from grey by lightness. */

/** What a heat map shows. */
export type Heat = 'stretch' | 'curvature';

/** The colours from the least value over the middle to the largest, as red, green, blue from 0 to 1. */
const SCALE: readonly (readonly [number, number, number])[] = [
  [0.02, 0.19, 0.38],
  [0.13, 0.4, 0.67],
  [0.57, 0.77, 0.87],
  [0.97, 0.97, 0.97],
  [0.99, 0.72, 0.39],
  [0.88, 0.51, 0.08],
  [0.5, 0.23, 0.03],
];
/** Where there is no number. */
const UNKNOWN = [0.42, 0.44, 0.47] as const;
/** How much darker the side away from the light is. */
const SHADE = 0.3;

/** The scale in steps, and how light a shade is, as light: large scans have millions of vertices. */
const TABLE = 1024;
const COLORS = Float32Array.from(
  [...Array.from({ length: TABLE + 1 }, (_, step) => colorAt(step / TABLE)), UNKNOWN].flatMap((color) =>
    color.map(linear),
  ),
);
const LIGHTS = Float32Array.from({ length: TABLE + 1 }, (_, step) => (1 - SHADE + (SHADE * step) / TABLE) ** 2.2);

/** The end of a scale: stretch 1 + `most` and its inverse, curvature `most` and its negative. */
export interface HeatScale {
  readonly heat: Heat;
  readonly most: number;
}

/** `red, green, blue` of each value, as light that three.js adds up; shaded, so that folds show. */
export function heatColors(
  values: Float32Array,
  shade: Float32Array,
  { heat, most }: HeatScale,
): Float32Array<ArrayBuffer> {
  const colors = new Float32Array(3 * values.length);
  const end = Math.log(1 + most);
  for (let at = 0; at < values.length; at += 1) {
    const value = values[at] as number;
    const place = heat === 'stretch' ? Math.log(value) / end : value / most;
    const light = LIGHTS[Math.round(TABLE * (shade[at] as number))] as number;
    // The last entry is that of unknown places.
    const entry = Number.isFinite(place) ? Math.round(TABLE * ((Math.min(Math.max(place, -1), 1) + 1) / 2)) : TABLE + 1;
    for (let channel = 0; channel < 3; channel += 1) {
      colors[3 * at + channel] = (COLORS[3 * entry + channel] as number) * light;
    }
  }
  return colors;
}

/** The colours as a gradient of a style sheet, from the least value to the largest. */
export function heatGradient(): string {
  const stops = SCALE.map((color) => `rgb(${color.map((channel) => Math.round(255 * channel)).join()})`);
  return `linear-gradient(to right, ${stops.join()})`;
}

/** The colour of unknown places, for a style sheet. */
export function unknownColor(): string {
  return `rgb(${UNKNOWN.map((channel) => Math.round(255 * channel)).join()})`;
}

/** The least round number that all but the most extreme twentieth of the values stay below: 1, 2 or 5 times a power of ten. */
export function scaleOf(heat: Heat, values: readonly Float32Array[]): HeatScale {
  const sizes: number[] = [];
  for (const list of values) {
    // Enough of them to know.
    const step = Math.max(1, Math.floor(list.length / 20_000));
    for (let at = 0; at < list.length; at += step) {
      const value = list[at] as number;
      const size = heat === 'stretch' ? Math.exp(Math.abs(Math.log(value))) - 1 : Math.abs(value);
      if (Number.isFinite(size)) {
        sizes.push(size);
      }
    }
  }
  sizes.sort((a, b) => a - b);
  const extreme = sizes[Math.floor(0.95 * sizes.length)] ?? 0;
  const least = heat === 'stretch' ? 0.02 : Number.MIN_VALUE;
  return { heat, most: roundUp(Math.max(extreme, least)) };
}

function roundUp(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const digit = [1, 2, 5, 10].find((it) => it * power >= value * 0.9999) ?? 10;
  return Number((digit * power).toPrecision(1));
}

/** @param share - From 0 to 1. */
function colorAt(share: number): readonly number[] {
  const along = share * (SCALE.length - 1);
  const from = Math.min(Math.floor(along), SCALE.length - 2);
  const [a, b] = [SCALE[from], SCALE[from + 1]] as [readonly number[], readonly number[]];
  return a.map((value, channel) => value + ((b[channel] as number) - value) * (along - from));
}

/** From a colour as screens have it to light (sRGB's transfer function). */
function linear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}
