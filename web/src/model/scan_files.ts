/** From the files that a person drops to the one file that is sent: a glTF whose data lies beside it gets it inside. */

/** What is needed of a dropped file. */
export type NamedFile = Blob & { readonly name: string };

/** What is needed of glTF's JSON. */
interface Gltf {
  buffers?: { uri?: string }[];
  images?: { uri?: string; mimeType?: string }[];
}

const SCAN = /\.(glb|gltf)$/i;
const IMAGE_TYPES: readonly (readonly [RegExp, string])[] = [
  [/\.png$/i, 'image/png'],
  [/\.jpe?g$/i, 'image/jpeg'],
  [/\.webp$/i, 'image/webp'],
];

/**
 * The scan among dropped files, as one file that refers to no other.
 *
 * @throws When a file that it refers to is not among them.
 */
export async function scanOf(files: readonly NamedFile[]): Promise<{ file: Blob; name: string } | undefined> {
  const scan = files.find(({ name }) => SCAN.test(name)) ?? files[0];
  if (scan === undefined) {
    return undefined;
  }
  const { name } = scan;
  if (!/\.gltf$/i.test(name)) {
    return { file: scan, name };
  }
  let gltf: Gltf;
  try {
    gltf = JSON.parse(await scan.text()) as Gltf;
  } catch {
    // The service says what is wrong with it.
    return { file: scan, name };
  }
  for (const item of [...(gltf.buffers ?? []), ...(gltf.images ?? [])]) {
    if (item.uri !== undefined && !item.uri.startsWith('data:')) {
      item.uri = await dataUri(beside(files, item.uri), item);
    }
  }
  return { file: new Blob([JSON.stringify(gltf)], { type: 'model/gltf+json' }), name };
}

/** The name of a scan without its ending, for files that are made of it. */
export function scanBaseName(name = 'scan'): string {
  return name.replace(/\.(glb|gltf)$/i, '');
}

/**
 * The scan at an address.
 *
 * @throws When the answer is none.
 */
export async function fetchedScan(address: URL, signal: AbortSignal | undefined): Promise<Blob> {
  const response = await fetch(address, { signal: signal ?? null });
  if (!response.ok) {
    throw new Error(`${address.href} answered with status ${response.status}.`);
  }
  return new Blob([await response.arrayBuffer()], { type: 'model/gltf-binary' });
}

function beside(files: readonly NamedFile[], uri: string): NamedFile {
  const wanted = decodeURIComponent(uri).split('/').pop();
  const found = files.find(({ name }) => name === wanted);
  if (found === undefined) {
    throw new Error(`The scan refers to the file ${wanted}; drop both together.`);
  }
  return found;
}

async function dataUri(file: NamedFile, item: { uri?: string; mimeType?: string }): Promise<string> {
  const image = IMAGE_TYPES.find(([ending]) => ending.test(file.name))?.[1];
  const type = item.mimeType ?? image ?? 'application/octet-stream';
  const bytes = new Uint8Array(await file.arrayBuffer());
  let text = '';
  // In pieces: a call takes only so many arguments.
  for (let at = 0; at < bytes.length; at += 32768) {
    text += String.fromCharCode(...bytes.subarray(at, at + 32768));
  }
  return `data:${type};base64,${btoa(text)}`;
}
