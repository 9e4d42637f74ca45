/** What the editor reads itself of a glTF's JSON. */
import type { Vec3 } from '../client.js';

/** A colour without images; the colour is linear. */
export interface PlainColour {
  readonly color: Vec3;
  readonly roughness: number;
  readonly metalness: number;
}

/** The name of the materials of patches that have a colour of their own. */
const OWN_COLOUR = 'darn reconstruction';

interface Primitive {
  readonly attributes?: Readonly<Record<string, number>>;
  readonly material?: number;
}

/** The parts of glTF 2.0 that are read. */
export interface GltfDocument {
  readonly extensionsUsed?: readonly string[];
  readonly images?: readonly unknown[];
  readonly meshes?: readonly { readonly primitives?: readonly Primitive[] }[];
  readonly materials?: readonly {
    readonly name?: string;
    readonly pbrMetallicRoughness?: {
      readonly baseColorTexture?: unknown;
      readonly baseColorFactor?: readonly number[];
      readonly roughnessFactor?: number;
      readonly metallicFactor?: number;
    };
  }[];
}

/** Bytes of a GLB before its JSON. */
export const GLB_HEADER = 20;

export function isGlb(bytes: ArrayBuffer): boolean {
  return bytes.byteLength >= GLB_HEADER && new TextDecoder().decode(bytes.slice(0, 4)) === 'glTF';
}

/** The JSON of a GLB as bytes. */
export function jsonOfGlb(bytes: ArrayBuffer): ArrayBuffer {
  return bytes.slice(GLB_HEADER, GLB_HEADER + new DataView(bytes).getUint32(12, true));
}

/** The JSON of a GLB or a glTF; empty where the bytes are neither, which the service has an error for. */
export function documentOf(bytes: ArrayBuffer): GltfDocument {
  const json = isGlb(bytes) ? jsonOfGlb(bytes) : bytes;
  try {
    return JSON.parse(new TextDecoder().decode(json)) as GltfDocument;
  } catch {
    return {};
  }
}

/** Whether a scan has colours that new cloth can take: images, or those of vertices. */
export function hasColours({ images = [], meshes = [] }: GltfDocument): boolean {
  const attributes = meshes.flatMap(({ primitives = [] }) =>
    primitives.flatMap((it) => Object.keys(it.attributes ?? {})),
  );
  return images.length > 0 || attributes.some((name) => name.startsWith('COLOR_'));
}

/**
 * The colours of patches that are neither in images nor the scan's, by hole.
 *
 * @param patches - As the service gives them: one mesh a hole, those with a colour of their own in a material of their own.
 * @param holes - Their ids, in the same order.
 */
export function plainColours(
  { meshes = [], materials = [] }: GltfDocument,
  holes: readonly number[],
): Map<number, PlainColour> {
  const colours = new Map<number, PlainColour>();
  for (const [at, id] of holes.entries()) {
    const { name, pbrMetallicRoughness: look } = materials[meshes[at]?.primitives?.[0]?.material ?? -1] ?? {};
    if (name !== OWN_COLOUR || look === undefined || look.baseColorTexture !== undefined) {
      continue;
    }
    const { baseColorFactor = [1, 1, 1], roughnessFactor: roughness = 1, metallicFactor: metalness = 1 } = look;
    colours.set(id, { color: baseColorFactor.slice(0, 3) as Vec3, roughness, metalness });
  }
  return colours;
}
