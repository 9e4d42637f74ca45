/**
 * From numbers to colours that people who see no red or green tell apart, and from the greys: blue below a middle and orange above, or from light
 * yellow down to dark brown, the darker the larger.
 */

/** What a heat map shows. */
export type Heat = 'stretch' | 'curvature' | 'confidence';

type Color = readonly [number, number, number];

/** Colours from the least value over the middle to the largest, as red, green, blue from 0 to 1. */
const TWO_SIDED: readonly Color[] = [
  [0.02, 0.19, 0.38],
  [0.13, 0.4, 0.67],
  [0.57, 0.77, 0.87],
  [0.97, 0.97, 0.97],
  [0.99, 0.72, 0.39],
  [0.88, 0.51, 0.08],
  [0.5, 0.23, 0.03],
];
/** Colours from 0 to the largest value, each darker than the one before. */
const ONE_SIDED: readonly Color[] = [
  [1, 0.97, 0.74],
  [1, 0.85, 0.4],
  [0.98, 0.62, 0.2],
  [0.85, 0.38, 0.08],
  [0.58, 0.2, 0.04],
  [0.3, 0.08, 0.03],
];
const SCALES: Readonly<Record<Heat, readonly Color[]>> = {
  stretch: TWO_SIDED,
  curvature: TWO_SIDED,
  confidence: ONE_SIDED,
};
/** Where there is no number. */
const UNKNOWN: Color = [0.42, 0.44, 0.47];
/** The scan's own cloth on a map of the new cloth alone. */
const OWN: Color = [0.725, 0.745, 0.775];
/** How much darker the side away from the light is. */
const SHADE = 0.3;

/** The scales in steps, and how light a shade is, as light: large scans have millions of vertices. */
const TABLE = 1024;
const TABLES: Readonly<Record<Heat, Float32Array>> = {
  stretch: tableOf(TWO_SIDED),
  curvature: tableOf(TWO_SIDED),
  confidence: tableOf(ONE_SIDED),
};
const LIGHTS = Float32Array.from({ length: TABLE + 1 }, (_, step) => (1 - SHADE + (SHADE * step) / TABLE) ** 2.2);

/** The end of a scale: stretch 1 + `most` and its inverse, curvature `most` and its negative, deviations 0 and `most`, NaN where none is known. */
export interface HeatScale {
  readonly heat: Heat;
  readonly most: number;
}

/** `red, green, blue` of each value, as light that three.js adds up; shaded, so that folds show. */
export function heatColors(values: Float32Array, shade: Float32Array, scale: HeatScale): Float32Array<ArrayBuffer> {
  const colors = new Float32Array(3 * values.length);
  const table = TABLES[scale.heat];
  for (let at = 0; at < values.length; at += 1) {
    const place = placeOf(values[at] as number, scale);
    const light = LIGHTS[Math.round(TABLE * (shade[at] as number))] as number;
    // The last entry is that of unknown places.
    const entry = Number.isFinite(place) ? Math.round(TABLE * Math.min(Math.max(place, 0), 1)) : TABLE + 1;
    for (let channel = 0; channel < 3; channel += 1) {
      colors[3 * at + channel] = (table[3 * entry + channel] as number) * light;
    }
  }
  return colors;
}

/** Where on a scale a value lies, 0 to 1; not finite where there is none. */
function placeOf(value: number, { heat, most }: HeatScale): number {
  switch (heat) {
    case 'stretch':
      return (Math.log(value) / Math.log(1 + most) + 1) / 2;
    case 'curvature':
      return (value / most + 1) / 2;
    case 'confidence':
      // All may be 0, where the cloth around a hole is flat.
      return value === 0 ? 0 : value / most;
  }
}

/** The colours of the scan on a map of the new cloth alone: one, shaded. */
export function ownColors(shade: Float32Array): Float32Array<ArrayBuffer> {
  const color = OWN.map(linear);
  const colors = new Float32Array(3 * shade.length);
  for (let at = 0; at < colors.length; at += 1) {
    const light = LIGHTS[Math.round(TABLE * (shade[Math.floor(at / 3)] as number))] as number;
    colors[at] = (color[at % 3] as number) * light;
  }
  return colors;
}

/** The colours of a map as a gradient of a style sheet, from the least value to the largest. */
export function heatGradient(heat: Heat): string {
  return `linear-gradient(to right, ${SCALES[heat].map(styleColor).join()})`;
}

/** The colours of unknown places and of the scan's own cloth, for a style sheet. */
export const UNKNOWN_STYLE = styleColor(UNKNOWN);
export const OWN_STYLE = styleColor(OWN);

/**
 * The end of a map's scale: the largest deviation, or the least round number that all but the most extreme twentieth of the values stay below: 1, 2
 * or 5 times a power of ten.
 */
export function scaleOf(heat: Heat, values: readonly Float32Array[]): HeatScale {
  if (heat === 'confidence') {
    const largest = values.flatMap((list) => [...list]).reduce((most, value) => (value > most ? value : most), -1);
    return { heat, most: largest < 0 ? Number.NaN : largest };
  }
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

function styleColor(color: Color): string {
  return `rgb(${color.map((channel) => Math.round(255 * channel)).join()})`;
}

/** A scale in steps, as light, and after it the colour of unknown places. */
function tableOf(scale: readonly Color[]): Float32Array {
  const steps = Array.from({ length: TABLE + 1 }, (_, step) => colorAt(scale, step / TABLE));
  return Float32Array.from([...steps, UNKNOWN].flatMap((color) => color.map(linear)));
}

/** @param share - From 0 to 1. */
function colorAt(scale: readonly Color[], share: number): readonly number[] {
  const along = share * (scale.length - 1);
  const from = Math.min(Math.floor(along), scale.length - 2);
  const [a, b] = [scale[from], scale[from + 1]] as [Color, Color];
  return a.map((value, channel) => value + ((b[channel] as number) - value) * (along - from));
}

/** From a colour as screens have it to light (sRGB's transfer function). */
function linear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}
