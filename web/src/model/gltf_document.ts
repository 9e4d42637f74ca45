/** What the editor reads itself of a glTF's JSON. */
import type { Vec3 } from '../client.js';

/** A colour without images; the colour is linear. */
export interface PlainColour {
  readonly color: Vec3;
  readonly roughness: number;
  readonly metalness: number;
}

interface Primitive {
  readonly attributes?: Readonly<Record<string, number>>;
  readonly material?: number;
  readonly extras?: { readonly darn?: { readonly holes?: readonly { readonly id?: number }[] } };
}

/** The parts of glTF 2.0 that are read. */
export interface GltfDocument {
  readonly images?: readonly unknown[];
  readonly meshes?: readonly { readonly primitives?: readonly Primitive[] }[];
  readonly materials?: readonly {
    readonly pbrMetallicRoughness?: {
      readonly baseColorFactor?: readonly number[];
      readonly roughnessFactor?: number;
      readonly metallicFactor?: number;
    };
  }[];
}

/** The JSON of a GLB or a glTF; empty where the bytes are neither, which the service has an error for. */
export function documentOf(bytes: ArrayBuffer): GltfDocument {
  const isGlb = bytes.byteLength >= 20 && new TextDecoder().decode(bytes.slice(0, 4)) === 'glTF';
  const json = isGlb ? bytes.slice(20, 20 + new DataView(bytes).getUint32(12, true)) : bytes;
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
 * The colours of a mended scan's patches by hole; of those with colours of vertices there is none.
 *
 * @param scan - As it was before.
 * @param holes - Those whose patches have no images.
 */
export function plainColours(
  mended: GltfDocument,
  scan: GltfDocument,
  holes: ReadonlySet<number>,
): Map<number, PlainColour> {
  const colours = new Map<number, PlainColour>();
  for (const [at, { primitives = [] }] of (mended.meshes ?? []).entries()) {
    // A scan that was mended before has patches already, whose holes had numbers of their own.
    const before = scan.meshes?.[at]?.primitives?.length ?? 0;
    for (const { attributes = {}, material = -1, extras } of primitives.slice(before)) {
      const look = mended.materials?.[material]?.pbrMetallicRoughness;
      if (look === undefined || 'COLOR_0' in attributes) {
        continue;
      }
      const { baseColorFactor = [1, 1, 1], roughnessFactor: roughness = 1, metallicFactor: metalness = 1 } = look;
      for (const { id = 0 } of extras?.darn?.holes ?? []) {
        if (holes.has(id)) {
          colours.set(id, { color: baseColorFactor.slice(0, 3) as Vec3, roughness, metalness });
        }
      }
    }
  }
  return colours;
}
