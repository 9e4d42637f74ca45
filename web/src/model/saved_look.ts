/** Which of its two looks of new cloth a saved scan has until a viewer's user chooses: both are in every file. */
import { GLB_HEADER, isGlb, jsonOfGlb } from './gltf_document.js';

/** Looks, with the variant (`KHR_materials_variants`) that each is. */
export const SAVED_LOOKS = [
  ['blended', 'Reconstruction blended', 'Like the cloth around it'],
  ['marked', 'Reconstruction marked', 'Marked by glowing stripes'],
] as const;

export type SavedLook = (typeof SAVED_LOOKS)[number][0];

const EXTENSION = 'KHR_materials_variants';

/** The parts of a glTF that are changed or read. */
interface VariantDocument {
  extensions?: { [EXTENSION]?: { variants?: { name?: string }[] } };
  meshes?: {
    primitives?: {
      material?: number;
      extensions?: { [EXTENSION]?: { mappings?: { material?: number; variants?: number[] }[] } };
    }[];
  }[];
}

/** A saved scan, as a GLB or a glTF, with one of the looks; itself where it has that already, as the service blends what it mends. */
export async function withLook(scan: Blob, look: SavedLook): Promise<Blob> {
  if (!scan.type.startsWith('model/gltf')) {
    return scan;
  }
  const bytes = await scan.arrayBuffer();
  const json = isGlb(bytes) ? jsonOfGlb(bytes) : new Uint8Array(bytes);
  const document = JSON.parse(new TextDecoder().decode(json)) as VariantDocument;
  if (!changeMaterials(document, look)) {
    return scan;
  }
  const [text, { type }] = [JSON.stringify(document), scan];
  return isGlb(bytes) ? glbOf(text, bytes.slice(GLB_HEADER + json.byteLength), type) : new Blob([text], { type });
}

/** Gives every primitive for which the look's variant has a material that material. Whether one had another. */
function changeMaterials(document: VariantDocument, look: SavedLook): boolean {
  const name = SAVED_LOOKS.find(([it]) => it === look)?.[1];
  const variant = document.extensions?.[EXTENSION]?.variants?.findIndex((it) => it.name === name) ?? -1;
  let hasChanged = false;
  for (const primitive of document.meshes?.flatMap(({ primitives = [] }) => primitives) ?? []) {
    const mappings = primitive.extensions?.[EXTENSION]?.mappings ?? [];
    const material = mappings.find(({ variants = [] }) => variants.includes(variant))?.material;
    if (material !== undefined && material !== primitive.material) {
      primitive.material = material;
      hasChanged = true;
    }
  }
  return hasChanged;
}

/** A GLB of a JSON and the chunks that follow it. */
function glbOf(text: string, rest: ArrayBuffer, type: string): Blob {
  const json = new TextEncoder().encode(text);
  const padding = new Uint8Array((4 - (json.length % 4)) % 4).fill(0x20);
  const length = json.length + padding.length;
  // Magic, version, length of all; length and kind of the first chunk.
  const header = new DataView(new ArrayBuffer(GLB_HEADER));
  const words = [0x46546c67, 2, GLB_HEADER + length + rest.byteLength, length, 0x4e4f534a];
  words.forEach((word, at) => header.setUint32(4 * at, word, true));
  return new Blob([header, json, padding, rest], { type });
}
