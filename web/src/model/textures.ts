/** Where the colour of new cloth comes from: the choices, and what was done. */
import type { Report, TextureReport } from '../client.js';

/** The constraint `texture`, and what each choice is called. */
export const TEXTURES = [
  ['synthesize', 'Images of its own'],
  ['continue', 'The scan\u2019s images go on'],
  ['flat', 'One colour'],
  ['none', 'Grey'],
] as const;

/** A choice; undefined: the service decides for each hole. */
export type Texture = (typeof TEXTURES)[number][0] | undefined;

/** What the service's own decision is called. */
export const UNDECIDED = 'As darn decides';

/** Whether a value is the constraint `texture`, or that it was left out. */
export function isTexture(value: unknown): value is Texture {
  return value === undefined || TEXTURES.some(([texture]) => texture === value);
}

/** What a choice is called as a step. */
export function textureName(texture: Texture): string {
  const name = TEXTURES.find(([it]) => it === texture)?.[1] ?? UNDECIDED;
  return `Colour of the new cloth: ${name.charAt(0).toLowerCase()}${name.slice(1)}`;
}

/** What the service says that it did, by what was asked. */
const METHODS = { synthesize: 'synthesized', continue: 'continued', flat: 'flat', none: 'none' } as const;

/** A choice that was applied, in one or two sentences. */
export function textureInWords(texture: Texture, report?: Report): string {
  const others = (report?.holes ?? []).filter((hole) => {
    return texture !== undefined && hole.texture !== undefined && hole.texture.method !== METHODS[texture];
  });
  const ids = others.map(({ id }) => id).join(', ');
  const not = others.length === 0 ? '' : ` Not in ${others.length === 1 ? 'hole' : 'holes'} ${ids}: see the report.`;
  return `${textureName(texture)}.${not}`;
}

/** Where the colour of a hole's patch comes from, and why. */
export function colourInWords({ method, reason = '', width = 0, height = 0 }: TextureReport): string {
  const what = new Map([
    ['synthesized', `images of its own, ${width} × ${height} texels`],
    ['continued', 'that of the scan goes on'],
    ['flat', 'one, the mean of the cloth around the hole'],
    ['none', 'grey'],
  ]).get(method ?? '');
  return `Its colour: ${what ?? method}${reason === '' ? '' : `; ${reason}`}.`;
}
